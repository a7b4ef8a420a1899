// A loop that does not fit: all poses since what has come back was seen last.
#include <Eigen/LU>

#include "dqslam/costs/measurements.h"
#include "dqslam/costs/whitening.h"
#include "dqslam/online/checkpoint.h"
#include "dqslam/online/initialize_object.h"
#include "dqslam/online/window.h"

namespace dqslam::online {
namespace {

constexpr int kIterations = 10;  // while objects that came back are points

// Observations [first, last) of an object as one of its own, where they alone put it.
template <typename Pose>
Object PartOf(const History<Pose>& history, const Object& object, int first, int last) {
  Object part;
  part.size = object.size;
  part.observations.assign(object.observations.begin() + first, object.observations.begin() + last);
  part.center_shape = object.center_shape;
  if (first == 0) {
    part.map = object.map;
  } else {
    part.center_shape = ObjectProblem(history, part).Reinitialize(true);
  }
  part.center_shape = ObjectProblem(history, part).ReinitializeIfBetter();
  return part;
}

// The first of the part's observations becomes a measurement of its position, and the others wait.
template <typename Pose>
void ShowAsPoint(const Object& part, History<Pose>* history) {
  const Matrix9d covariance =
      ObjectProblem(*history, part).InformationAt(part.center_shape).inverse();
  Observation& first = history->observations[part.observations.front()];
  for (const int row : part.observations) {
    if (row != part.observations.front()) history->observations[row].object = -1;
  }
  const Rigid<double> robot = Pose::WorldFromRobot(history->poses[first.pose].data());
  const Eigen::Matrix3d& R = robot.rotation;
  const Eigen::Matrix3d covariance_in_robot = R.transpose() * covariance.topLeftCorner<3, 3>() * R;
  first.SetMeasurement(MeasurementKind("position"),
                       R.transpose() * (part.center_shape.head<3>() - robot.translation),
                       SqrtInformation<3>(covariance_in_robot));
}

// Each object that the window sees after an absence goes back to where it was before, and what has
// been seen of it since becomes a point.
template <typename Pose>
void ShowReturnsAsPoints(int window_begin, int absence, History<Pose>* history) {
  for (const int row : history->ObjectsSeenFrom(window_begin)) {
    Object& object = history->objects[row];
    const auto pose_of = [&](int i) { return history->observations[object.observations[i]].pose; };
    const int count = static_cast<int>(object.observations.size());
    int first = count - 1;
    while (first > 0 && pose_of(first) - pose_of(first - 1) <= absence) --first;
    if (first == 0) continue;
    const Object before = PartOf(*history, object, 0, first);
    ShowAsPoint(PartOf(*history, object, first, count), history);
    object.center_shape = before.center_shape;
  }
}

}  // namespace

template <typename Pose>
WindowResult Window<Pose>::CloseLoop(int begin, int window_begin, const OnlineOptions& options) {
  const auto minimize = [&](int iterations) {
    double damping = kFirstDamping;
    return Minimize(begin, MarginalPriors::kRelinearize, iterations, &damping);
  };
  const Checkpoint<Pose> apart(history_, begin);
  WindowResult best = minimize(options.loop_iterations);
  if (best.undefined == 0 && best.misfits.empty()) return best;

  const Checkpoint<Pose> closed(history_, begin);
  apart.Restore(&history_);
  history_.DeadReckon(window_begin);
  const std::vector<Observation> observations = history_.observations;
  ShowReturnsAsPoints(window_begin, options.loop_absence, &history_);
  const WindowResult points = minimize(kIterations);
  history_.observations = observations;
  const WindowResult boxes = minimize(options.loop_iterations);
  const int linearized = best.linearized + points.linearized + boxes.linearized;
  if (boxes.PenalizedCost() < best.PenalizedCost()) {
    best = boxes;
  } else {
    closed.Restore(&history_);
  }
  best.linearized = linearized;
  return best;
}

template WindowResult Window<Se2>::CloseLoop(int, int, const OnlineOptions&);
template WindowResult Window<Se3>::CloseLoop(int, int, const OnlineOptions&);

}  // namespace dqslam::online
