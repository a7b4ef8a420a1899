#include "dqslam/online/recover.h"

#include <algorithm>

#include "dqslam/online/restart.h"
#include "dqslam/online/start.h"

namespace dqslam::online {
namespace {

constexpr int kIterations = 10;
constexpr double kFirstDamping = 1e-8;

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
  double best = CostOf(first);
  int linearized = first.linearized;
  for (const bool by_size : {false, true}) {
    const Checkpoint<Pose> checkpoint(*history, begin);
    BackToOdometry(begin, history);
    for (const int row : young) {
      Object& object = history->objects[row];
      object.chart = StartAgain(model, *history, object, by_size);
    }
    damping = kFirstDamping;
    const Work towards =
        region->Minimize(history, begin, Past::kAnew, kIterations, &damping, Edges::kTangent);
    const Work work = region->Minimize(history, begin, Past::kAnew, kIterations, &damping);
    linearized += towards.linearized + work.linearized;
    if (CostOf(work) < best) {
      best = CostOf(work);
    } else {
      checkpoint.Restore(history);
    }
  }
  return linearized;
}

template int Recover<Se2>(const Model&, int, const OnlineOptions&, Region<Se2>*, History<Se2>*);
template int Recover<Se3>(const Model&, int, const OnlineOptions&, Region<Se3>*, History<Se3>*);

}  // namespace dqslam::online
