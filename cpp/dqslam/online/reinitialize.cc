#include "dqslam/online/reinitialize.h"

#include <algorithm>

#include "dqslam/online/checkpoint.h"
#include "dqslam/online/initialize_object.h"

namespace dqslam::online {
namespace {

constexpr int kIterations = 10;
constexpr double kFirstDamping = 1e-8;

// Objects of no map that were seen first from `begin` on.
template <typename Pose>
std::vector<int> YoungObjects(const History<Pose>& history, int begin) {
  std::vector<int> young;
  const int first = history.ObservationsBefore(begin);
  for (int row = first; row < static_cast<int>(history.observations.size()); ++row) {
    if (history.observations[row].Waits()) continue;
    const Object& object = history.objects[history.observations[row].object];
    const bool is_first = object.observations.front() == row;
    if (is_first && object.map.H.isZero(0)) young.push_back(history.observations[row].object);
  }
  return young;
}

}  // namespace

template <typename Pose>
int Recover(const Model& model,
            int begin,
            const OnlineOptions& options,
            Window<Pose>* window,
            History<Pose>* history) {
  using MarginalPriors = typename Window<Pose>::MarginalPriors;
  const std::vector<int> young = YoungObjects(*history, begin);
  double damping = kFirstDamping;
  const WindowResult first = window->Minimize(
      history, begin, MarginalPriors::kRelinearize, options.smoothing_iterations, &damping);
  double best = CostOf(first);
  int linearized = first.linearized;
  for (const bool by_size : {false, true}) {
    const Checkpoint<Pose> checkpoint(*history, begin);
    BackToOdometry(begin, history);
    for (const int row : young) {
      Object& object = history->objects[row];
      object.center_shape = Reinitialize(model, *history, object, by_size);
    }
    damping = kFirstDamping;
    const WindowResult towards = window->Minimize(
        history, begin, MarginalPriors::kRelinearize, kIterations, &damping, Edges::kTangent);
    const WindowResult result =
        window->Minimize(history, begin, MarginalPriors::kRelinearize, kIterations, &damping);
    linearized += towards.linearized + result.linearized;
    if (CostOf(result) < best) {
      best = CostOf(result);
    } else {
      checkpoint.Restore(history);
    }
  }
  return linearized;
}

template int Recover<Se2>(const Model&, int, const OnlineOptions&, Window<Se2>*, History<Se2>*);
template int Recover<Se3>(const Model&, int, const OnlineOptions&, Window<Se3>*, History<Se3>*);

}  // namespace dqslam::online
