// Recent poses and the objects they saw first, started again where a window cannot leave a place.
#include "dqslam/online/checkpoint.h"
#include "dqslam/online/initialize_object.h"
#include "dqslam/online/window.h"

namespace dqslam::online {
namespace {

constexpr int kIterations = 10;

}  // namespace

template <typename Pose>
WindowResult Window<Pose>::Reinitialize(int begin, int iterations) {
  const int first_observation = history_.ObservationsBefore(begin);
  double damping = kFirstDamping;
  WindowResult best = Minimize(begin, MarginalPriors::kRelinearize, iterations, &damping);
  int linearized = best.linearized;
  for (const bool by_size : {false, true}) {
    const Checkpoint<Pose> checkpoint(history_, begin);
    history_.DeadReckon(begin);
    for (const int row : history_.ObjectsSeenFrom(begin)) {
      Object& object = history_.objects[row];
      if (object.observations.front() < first_observation || object.IsOfMap()) continue;
      object.center_shape = ObjectProblem(history_, object).Reinitialize(by_size);
    }
    damping = kFirstDamping;
    const WindowResult towards = Minimize(
        begin, MarginalPriors::kRelinearize, kIterations, &damping, EdgeResidual::kTangent);
    const WindowResult result =
        Minimize(begin, MarginalPriors::kRelinearize, kIterations, &damping);
    linearized += towards.linearized + result.linearized;
    if (result.PenalizedCost() < best.PenalizedCost()) {
      best = result;
    } else {
      checkpoint.Restore(&history_);
    }
  }
  best.linearized = linearized;
  return best;
}

template WindowResult Window<Se2>::Reinitialize(int, int);
template WindowResult Window<Se3>::Reinitialize(int, int);

}  // namespace dqslam::online
