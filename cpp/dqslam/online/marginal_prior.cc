#include "dqslam/online/marginal_prior.h"

namespace dqslam::online {
namespace {

// What is kept is linearized anew when it has grown by this factor.
constexpr double kGrowth = 1.25;

}  // namespace

template <typename Pose>
int CountMarginalized(const History<Pose>& history, const Object& object, int pose, int known) {
  const int before = history.ObservationsBefore(pose);
  const int count = static_cast<int>(object.observations.size());
  while (known < count && object.observations[known] < before) ++known;
  return known;
}

template <typename Pose>
void AddToMarginalPrior(const Model& model,
                        const History<Pose>& history,
                        const Object& object,
                        int first,
                        int last,
                        GaussianPrior* marginal) {
  Linear<Pose> linear;
  const Vector9d d = object.center_shape - marginal->origin;
  for (int i = first; i < last; ++i) {
    const Observation& observation = history.observations[object.observations[i]];
    const Station station = Station::At<Pose>(history.poses[observation.pose].data(), model.mount);
    Linearize<Pose>(model, station, observation, object.center_shape, Edges::kBox, &linear);
    const Matrix9d H = linear.by_object.transpose() * linear.by_object;
    marginal->H += H;
    const Vector9d g = linear.by_object.transpose() * linear.residual;
    marginal->g += g - H * d;
    marginal->cost += linear.cost - g.dot(d) + 0.5 * d.dot(H * d);
  }
}

template <typename Pose>
int UpdateMarginalPriors(const Model& model, int begin, History<Pose>* history) {
  int linearized = 0;
  const int first = history->ObservationsBefore(begin);
  for (int row = first; row < static_cast<int>(history->observations.size()); ++row) {
    if (history->observations[row].Waits()) continue;
    Object& object = history->objects[history->observations[row].object];
    const int known = object.is_stale ? 0 : object.marginalized_observations;
    const int count = CountMarginalized(*history, object, begin, known);
    if (!object.is_stale && count == object.marginalized_observations) continue;
    int from = object.marginalized_observations;
    if (object.is_stale || count > kGrowth * object.linearized) {
      object.marginal = GaussianPrior();
      object.marginal.origin = object.center_shape;
      object.linearized = count;
      object.is_stale = false;
      from = 0;
    }
    AddToMarginalPrior(model, *history, object, from, count, &object.marginal);
    object.marginalized_observations = count;
    linearized += count - from;
  }
  return linearized;
}

template <typename Pose>
void MarkStale(int begin, History<Pose>* history) {
  const int first = history->ObservationsBefore(begin);
  for (int row = first; row < static_cast<int>(history->observations.size()); ++row) {
    const Observation& observation = history->observations[row];
    if (!observation.Waits()) history->objects[observation.object].is_stale = true;
  }
}

#define DQSLAM_INSTANTIATE(Pose)                                                       \
  template int CountMarginalized<Pose>(const History<Pose>&, const Object&, int, int); \
  template void AddToMarginalPrior<Pose>(                                              \
      const Model&, const History<Pose>&, const Object&, int, int, GaussianPrior*);    \
  template int UpdateMarginalPriors<Pose>(const Model&, int, History<Pose>*);          \
  template void MarkStale<Pose>(int, History<Pose>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
