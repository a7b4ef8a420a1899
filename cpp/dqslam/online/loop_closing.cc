#include "dqslam/online/loop_closing.h"

#include <Eigen/LU>

#include "dqslam/costs/whitening.h"
#include "dqslam/online/checkpoint.h"
#include "dqslam/online/initialize_object.h"

namespace dqslam::online {
namespace {

constexpr double kFirstDamping = 1e-8;
constexpr int kIterations = 10;

// An object that has come back.
struct Return {
  int object;
  Vector9d before;                // where its observations before the absence put it
  std::vector<int> observations;  // those since
  Eigen::Vector3d center;         // where these alone put it [m], with covariance
  Eigen::Matrix3d covariance;
};

// Observations [first, last) of an object as one of its own, where they alone put it.
template <typename Pose>
Object PartOf(
    const Model& model, const History<Pose>& history, const Object& object, int first, int last) {
  Object part;
  part.size = object.size;
  part.observations.assign(object.observations.begin() + first, object.observations.begin() + last);
  part.center_shape = object.center_shape;
  if (first == 0) {
    part.map = object.map;
  } else {
    part.center_shape = Reinitialize(model, history, part, true);
  }
  ReinitializeIfBetter(model, history, &part);
  return part;
}

// The objects that the window sees after an absence.
template <typename Pose>
std::vector<Return> Returns(const Model& model,
                            const History<Pose>& history,
                            int window_begin,
                            int absence) {
  std::vector<Return> returns;
  std::vector<bool> done(history.objects.size(), false);
  const int observations = static_cast<int>(history.observations.size());
  for (int row = history.ObservationsBefore(window_begin); row < observations; ++row) {
    const int name = history.observations[row].object;
    if (name < 0 || done[name]) continue;
    done[name] = true;
    const Object& object = history.objects[name];
    const auto pose_of = [&](int i) { return history.observations[object.observations[i]].pose; };
    const int count = static_cast<int>(object.observations.size());
    int first = count - 1;
    while (first > 0 && pose_of(first) - pose_of(first - 1) <= absence) --first;
    if (first == 0) continue;
    const Object before = PartOf(model, history, object, 0, first);
    const Object since = PartOf(model, history, object, first, count);
    const Matrix9d covariance = InformationAt(model, history, since).inverse();
    returns.push_back({name,
                       before.center_shape,
                       since.observations,
                       since.center_shape.head<3>(),
                       covariance.topLeftCorner<3, 3>()});
  }
  return returns;
}

// The first of its observations since is a measurement of its position, and the others wait.
template <typename Pose>
void ShowAsPoint(const Return& back, History<Pose>* history) {
  for (const int row : back.observations) history->observations[row].object = -1;
  Observation& observation = history->observations[back.observations.front()];
  const Rigid<double> robot = Pose::WorldFromRobot(history->poses[observation.pose].data());
  const Eigen::Matrix3d& R = robot.rotation;
  observation.object = back.object;
  observation.is_box = false;
  observation.value << R.transpose() * (back.center - robot.translation), 0;
  observation.sqrt_information.setZero();
  observation.sqrt_information.topLeftCorner<3, 3>() =
      SqrtInformation<3>(R.transpose() * back.covariance * R);
}

}  // namespace

template <typename Pose>
WindowResult CloseLoop(const Model& model,
                       int begin,
                       int window_begin,
                       const OnlineOptions& options,
                       Window<Pose>* window,
                       History<Pose>* history) {
  using MarginalPriors = typename Window<Pose>::MarginalPriors;
  const auto minimize = [&](int iterations) {
    double damping = kFirstDamping;
    return window->Minimize(history, begin, MarginalPriors::kRelinearize, iterations, &damping);
  };
  const Checkpoint<Pose> apart(*history, begin);
  WindowResult best = minimize(options.loop_iterations);
  if (best.undefined == 0 && best.misfits.empty()) return best;

  const Checkpoint<Pose> closed(*history, begin);
  apart.Restore(history);
  BackToOdometry(window_begin, history);
  const std::vector<Observation> observations = history->observations;
  for (const Return& back : Returns(model, *history, window_begin, options.loop_absence)) {
    history->objects[back.object].center_shape = back.before;
    ShowAsPoint(back, history);
  }
  const WindowResult points = minimize(kIterations);
  history->observations = observations;
  WindowResult boxes = minimize(options.loop_iterations);
  const int linearized = best.linearized + points.linearized + boxes.linearized;
  if (CostOf(boxes) < CostOf(best)) {
    best = boxes;
  } else {
    closed.Restore(history);
  }
  best.linearized = linearized;
  return best;
}

#define DQSLAM_INSTANTIATE(Pose)         \
  template WindowResult CloseLoop<Pose>( \
      const Model&, int, int, const OnlineOptions&, Window<Pose>*, History<Pose>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
