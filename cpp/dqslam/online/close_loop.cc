#include "dqslam/online/close_loop.h"

#include <Eigen/LU>

#include "dqslam/online/restart.h"
#include "dqslam/online/start.h"
#include "dqslam/whitening.h"

namespace dqslam::online {
namespace {

constexpr double kFirstDamping = 1e-8;
constexpr int kIterations = 10;

// An object that has come back.
struct Return {
  int object;
  Vector9d before;          // where its sights before the absence put it
  std::vector<int> sights;  // those since
  Eigen::Vector3d center;   // where these alone put it [m], with covariance
  Eigen::Matrix3d covariance;
};

// Sights [first, last) of an object as one of its own, where they alone put it.
template <typename Pose>
Object PartOf(
    const Model& model, const History<Pose>& history, const Object& object, int first, int last) {
  Object part;
  part.size = object.size;
  part.sights.assign(object.sights.begin() + first, object.sights.begin() + last);
  part.chart = object.chart;
  if (first == 0) {
    part.map = object.map;
  } else {
    part.chart = StartAgain(model, history, part, true);
  }
  TryAgain(model, history, &part);
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
  const int sights = static_cast<int>(history.sights.size());
  for (int row = history.SightsBefore(window_begin); row < sights; ++row) {
    const int name = history.sights[row].object;
    if (name < 0 || done[name]) continue;
    done[name] = true;
    const Object& object = history.objects[name];
    const auto pose_of = [&](int i) { return history.sights[object.sights[i]].pose; };
    const int count = static_cast<int>(object.sights.size());
    int first = count - 1;
    while (first > 0 && pose_of(first) - pose_of(first - 1) <= absence) --first;
    if (first == 0) continue;
    const Object before = PartOf(model, history, object, 0, first);
    const Object since = PartOf(model, history, object, first, count);
    const Matrix9d covariance = InformationAt(model, history, since).inverse();
    returns.push_back({name,
                       before.chart,
                       since.sights,
                       since.chart.head<3>(),
                       covariance.topLeftCorner<3, 3>()});
  }
  return returns;
}

// The first of its sights since is a measurement of its position, and the others wait.
template <typename Pose>
void ShowAsPoint(const Return& back, History<Pose>* history) {
  for (const int row : back.sights) history->sights[row].object = -1;
  Sight& sight = history->sights[back.sights.front()];
  const Rigid<double> robot = Pose::WorldFromRobot(history->poses[sight.pose].data());
  const Eigen::Matrix3d& R = robot.rotation;
  sight.object = back.object;
  sight.is_box = false;
  sight.value << R.transpose() * (back.center - robot.translation), 0;
  sight.sqrt_information.setZero();
  sight.sqrt_information.topLeftCorner<3, 3>() =
      SqrtInformation<3>(R.transpose() * back.covariance * R);
}

}  // namespace

template <typename Pose>
Work CloseLoop(const Model& model,
               int begin,
               int window_begin,
               const OnlineOptions& options,
               Region<Pose>* region,
               History<Pose>* history) {
  using Past = typename Region<Pose>::Past;
  const auto minimize = [&](int iterations) {
    double damping = kFirstDamping;
    return region->Minimize(history, begin, Past::kAnew, iterations, &damping);
  };
  const Checkpoint<Pose> apart(*history, begin);
  Work best = minimize(options.loop_iterations);
  if (best.undefined == 0 && best.misfits.empty()) return best;

  const Checkpoint<Pose> closed(*history, begin);
  apart.Restore(history);
  BackToOdometry(window_begin, history);
  const std::vector<Sight> sights = history->sights;
  for (const Return& back : Returns(model, *history, window_begin, options.loop_absence)) {
    history->objects[back.object].chart = back.before;
    ShowAsPoint(back, history);
  }
  const Work points = minimize(kIterations);
  history->sights = sights;
  Work boxes = minimize(options.loop_iterations);
  const int linearized = best.linearized + points.linearized + boxes.linearized;
  if (CostOf(boxes) < CostOf(best)) {
    best = boxes;
  } else {
    closed.Restore(history);
  }
  best.linearized = linearized;
  return best;
}

#define DQSLAM_INSTANTIATE(Pose) \
  template Work CloseLoop<Pose>( \
      const Model&, int, int, const OnlineOptions&, Region<Pose>*, History<Pose>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
