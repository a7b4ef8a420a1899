#include "dqslam/online/initialize_object.h"

#include <algorithm>
#include <cmath>

#include "dqslam/online/levenberg_marquardt.h"
#include "dqslam/online/linearize.h"

namespace dqslam::online {
namespace {

constexpr int kIterations = 6;
constexpr double kTolerance = 1e-4;

}  // namespace

template <typename Pose>
ObjectProblem<Pose>::ObjectProblem(const History<Pose>& history, const Object& object)
    : model_(history.model), object_(object), depths_(object.observations.size(), 0) {
  for (const int row : object.observations) {
    observations_.push_back(&history.observations[row]);
    stations_.push_back(history.StationAt(observations_.back()->pose));
  }
}

template <typename Pose>
Vector9d ObjectProblem<Pose>::Initialize() const {
  const Observation& first = *observations_.front();
  const Station& station = stations_.front();
  if (first.IsBox()) {
    const View view{station.camera, first.value, first.SqrtInformation(), first.truncated};
    return CenterShapeFromEllipsoid(BackProject(model_.camera, {view}, object_.size));
  }
  const Rigid<double>& robot = station.world_from_robot;
  const Eigen::Vector3d center = robot.rotation * first.value.head<3>() + robot.translation;
  return CenterShapeFromEllipsoid(Sphere(center, std::exp(object_.size.log_mean)));
}

template <typename Pose>
Vector9d ObjectProblem<Pose>::Reinitialize(bool by_size) const {
  std::vector<View> views;
  for (size_t i = 0; i < observations_.size(); ++i) {
    const Observation& one = *observations_[i];
    if (!one.IsBox()) continue;
    views.push_back({stations_[i].camera, one.value, one.SqrtInformation(), one.truncated});
  }
  if (views.empty()) return object_.center_shape;
  return CenterShapeFromEllipsoid(by_size ? BackProject(model_.camera, views, object_.size)
                                          : FitSphere(model_.camera, views, object_.size));
}

template <typename Pose>
double ObjectProblem<Pose>::Refine(Vector9d* center_shape) {
  const double cost = LevenbergMarquardt<9>(
      kIterations,
      kTolerance,
      center_shape,
      [&](const Vector9d& at, Matrix9d* H, Vector9d* g) { return Linearize(at, H, g); },
      RetractCenterShape,
      [&](const Vector9d& at) { return CostAt(at); });
  const auto is_undefined = [](double depth) { return depth > 0; };
  return cost + kUndefinedCost * std::count_if(depths_.begin(), depths_.end(), is_undefined);
}

template <typename Pose>
Vector9d ObjectProblem<Pose>::ReinitializeIfBetter() {
  Vector9d best = object_.center_shape;
  double cost = Refine(&best);
  for (const bool by_size : {false, true}) {
    Vector9d other = Reinitialize(by_size);
    const double other_cost = Refine(&other);
    if (!(other_cost < cost)) continue;
    cost = other_cost;
    best = other;
  }
  return best;
}

template <typename Pose>
Matrix9d ObjectProblem<Pose>::InformationAt(const Vector9d& center_shape) {
  Matrix9d H;
  Vector9d unused;
  Linearize(center_shape, &H, &unused);
  return H;
}

template <typename Pose>
double ObjectProblem<Pose>::Linearize(const Vector9d& center_shape, Matrix9d* H, Vector9d* g) {
  GaussianPrior sum;
  double cost = AddPriors(model_, object_, center_shape, &sum);
  LinearizedObservation<Pose> linear;
  for (size_t i = 0; i < observations_.size(); ++i) {
    online::Linearize(
        model_, stations_[i], *observations_[i], center_shape, EdgeResidual::kBox, &linear);
    sum.H.noalias() += linear.by_object.transpose() * linear.by_object;
    sum.g += linear.by_object.transpose() * linear.residual;
    cost += linear.cost;
    depths_[i] = linear.depth;
  }
  *H = sum.H;
  *g = sum.g;
  return cost;
}

template <typename Pose>
double ObjectProblem<Pose>::CostAt(const Vector9d& center_shape) const {
  double cost = CostOfPriors(model_, object_, center_shape), unused;
  for (size_t i = 0; i < observations_.size(); ++i) {
    cost += CostOfObservation<Pose>(
        model_, stations_[i], *observations_[i], center_shape, depths_[i], &unused);
  }
  return cost;
}

template class ObjectProblem<Se2>;
template class ObjectProblem<Se3>;

}  // namespace dqslam::online
