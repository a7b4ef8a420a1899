#include "dqslam/online/recover.h"

#include <algorithm>

#include "dqslam/online/start.h"

namespace dqslam::online {
namespace {

constexpr int kIterations = 10;
constexpr double kFirstDamping = 1e-4;
// What a sight costs beside its tangent residual while its object is not in front.
constexpr double kUndefinedCost = 50;

double Cost(const Work& work) {
  return work.cost + kUndefinedCost * work.undefined;
}

// Objects of no map that were seen first from `begin` on.
template <typename Pose>
std::vector<int> YoungObjects(const History<Pose>& history, int begin) {
  std::vector<int> young;
  const int first = history.SightsBefore(begin);
  for (int row = first; row < static_cast<int>(history.sights.size()); ++row) {
    if (history.sights[row].Waits()) continue;
    const Object& object = history.objects[history.sights[row].object];
    const bool is_first = object.sights.front() == row;
    if (is_first && object.map.H.isZero(0)) young.push_back(history.sights[row].object);
  }
  return young;
}

}  // namespace

template <typename Pose>
int Recover(const Model& model,
            int begin,
            const OnlineOptions& options,
            Region<Pose>* region,
            History<Pose>* history) {
  using Past = typename Region<Pose>::Past;
  const std::vector<int> young = YoungObjects(*history, begin);
  double damping = kFirstDamping;
  const Work first =
      region->Minimize(history, begin, Past::kAnew, options.smoothing_iterations, &damping);
  double best = Cost(first);
  int linearized = first.linearized;
  for (const bool by_size : {false, true}) {
    const std::vector<typename History<Pose>::Storage> poses(history->poses.begin() + begin,
                                                             history->poses.end());
    std::vector<Vector9d> charts;
    for (const Object& object : history->objects) charts.push_back(object.chart);
    for (int pose = std::max(begin, 1); pose < history->num_poses(); ++pose) {
      Pose::Compose(history->poses[pose - 1].data(),
                    history->steps[pose].relative.data(),
                    history->poses[pose].data());
    }
    for (const int row : young) {
      Object& object = history->objects[row];
      object.chart = StartAgain(model, *history, object, by_size);
    }
    damping = kFirstDamping;
    const Work towards =
        region->Minimize(history, begin, Past::kAnew, kIterations, &damping, Edges::kTangent);
    const Work work = region->Minimize(history, begin, Past::kAnew, kIterations, &damping);
    linearized += towards.linearized + work.linearized;
    if (Cost(work) < best) {
      best = Cost(work);
      continue;
    }
    std::copy(poses.begin(), poses.end(), history->poses.begin() + begin);
    for (size_t row = 0; row < charts.size(); ++row) history->objects[row].chart = charts[row];
  }
  return linearized;
}

template int Recover<Se2>(const Model&, int, const OnlineOptions&, Region<Se2>*, History<Se2>*);
template int Recover<Se3>(const Model&, int, const OnlineOptions&, Region<Se3>*, History<Se3>*);

}  // namespace dqslam::online
