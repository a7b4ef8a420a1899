#include "dqslam/online/past.h"

namespace dqslam::online {
namespace {

// What is kept is linearised anew when it has grown by this factor.
constexpr double kGrowth = 1.25;

}  // namespace

template <typename Pose>
int CountPast(const History<Pose>& history, const Object& object, int pose, int known) {
  const int before = history.SightsBefore(pose);
  const int count = static_cast<int>(object.sights.size());
  while (known < count && object.sights[known] < before) ++known;
  return known;
}

template <typename Pose>
void AddPast(const Model& model,
             const History<Pose>& history,
             const Object& object,
             int first,
             int last,
             Quadratic* past) {
  Linear<Pose> linear;
  const Vector9d d = object.chart - past->origin;
  for (int i = first; i < last; ++i) {
    const Sight& sight = history.sights[object.sights[i]];
    const Station station = Station::At<Pose>(history.poses[sight.pose].data(), model.mount);
    Linearize<Pose>(model, station, sight, object.chart, Edges::kBox, &linear);
    const Matrix9d H = linear.by_object.transpose() * linear.by_object;
    past->H += H;
    const Vector9d g = linear.by_object.transpose() * linear.residual;
    past->g += g - H * d;
    past->cost += linear.cost - g.dot(d) + 0.5 * d.dot(H * d);
  }
}

template <typename Pose>
int KeepPast(const Model& model, int begin, History<Pose>* history) {
  int linearized = 0;
  const int first = history->SightsBefore(begin);
  for (int row = first; row < static_cast<int>(history->sights.size()); ++row) {
    if (history->sights[row].Waits()) continue;
    Object& object = history->objects[history->sights[row].object];
    const int known = object.is_stale ? 0 : object.past_sights;
    const int count = CountPast(*history, object, begin, known);
    if (!object.is_stale && count == object.past_sights) continue;
    int from = object.past_sights;
    if (object.is_stale || count > kGrowth * object.linearized) {
      object.past = Quadratic();
      object.past.origin = object.chart;
      object.linearized = count;
      object.is_stale = false;
      from = 0;
    }
    AddPast(model, *history, object, from, count, &object.past);
    object.past_sights = count;
    linearized += count - from;
  }
  return linearized;
}

template <typename Pose>
void MarkStale(int begin, History<Pose>* history) {
  const int first = history->SightsBefore(begin);
  for (int row = first; row < static_cast<int>(history->sights.size()); ++row) {
    const Sight& sight = history->sights[row];
    if (!sight.Waits()) history->objects[sight.object].is_stale = true;
  }
}

#define DQSLAM_INSTANTIATE(Pose)                                                \
  template int CountPast<Pose>(const History<Pose>&, const Object&, int, int);  \
  template void AddPast<Pose>(                                                  \
      const Model&, const History<Pose>&, const Object&, int, int, Quadratic*); \
  template int KeepPast<Pose>(const Model&, int, History<Pose>*);               \
  template void MarkStale<Pose>(int, History<Pose>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
