#include "dqslam/online/initialize_object.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dqslam::online {
namespace {

constexpr int kRefineIterations = 6;
// What a observation costs beside its tangent residual while its object is not in front.
constexpr double kUndefinedCost = 50;

template <typename Pose>
std::vector<View> ViewsOf(const Model& model, const History<Pose>& history, const Object& object) {
  std::vector<View> views;
  for (const int row : object.observations) {
    const Observation& observation = history.observations[row];
    if (!observation.is_box) continue;
    const Station station = Station::At<Pose>(history.poses[observation.pose].data(), model.mount);
    views.push_back(
        {station.camera, observation.value, observation.sqrt_information, observation.truncated});
  }
  return views;
}

// Derivatives at a center_shape, and the residuals that were used.
template <typename Pose>
double LinearizeAt(const Model& model,
                   const History<Pose>& history,
                   const Object& object,
                   const Vector9d& center_shape,
                   GaussianPrior* sum,
                   std::vector<double>* depths) {
  double cost = AddPriors(model, object, center_shape, sum);
  depths->clear();
  Linear<Pose> linear;
  for (const int row : object.observations) {
    const Observation& observation = history.observations[row];
    const Station station = Station::At<Pose>(history.poses[observation.pose].data(), model.mount);
    Linearize<Pose>(model, station, observation, center_shape, Edges::kBox, &linear);
    sum->H.noalias() += linear.by_object.transpose() * linear.by_object;
    sum->g += linear.by_object.transpose() * linear.residual;
    cost += linear.cost;
    depths->push_back(linear.depth);
  }
  return cost;
}

template <typename Pose>
double CostAt(const Model& model,
              const History<Pose>& history,
              const Object& object,
              const Vector9d& center_shape,
              const std::vector<double>& depths) {
  double cost = CostOfPriors(model, object, center_shape), unused;
  for (size_t i = 0; i < object.observations.size(); ++i) {
    const Observation& observation = history.observations[object.observations[i]];
    const Station station = Station::At<Pose>(history.poses[observation.pose].data(), model.mount);
    cost += CostOfObservation<Pose>(model, station, observation, center_shape, depths[i], &unused);
  }
  return cost;
}

}  // namespace

template <typename Pose>
double RefineObject(const Model& model,
                    const History<Pose>& history,
                    const Object& object,
                    int iterations,
                    Vector9d* center_shape) {
  double damping = 1e-3, cost = std::numeric_limits<double>::infinity();
  std::vector<double> depths;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    GaussianPrior sum;
    cost = LinearizeAt(model, history, object, *center_shape, &sum, &depths);
    Matrix9d H = sum.H;
    H.diagonal() *= 1 + damping;
    const Vector9d step = -H.ldlt().solve(sum.g);
    Vector9d trial;
    const bool possible = step.allFinite() && Move(*center_shape, step, &trial);
    const double after = possible ? CostAt(model, history, object, trial, depths) : cost;
    if (!(after < cost)) {
      damping *= 10;
      continue;
    }
    const bool done = cost - after < 1e-4 * cost;
    *center_shape = trial;
    cost = after;
    damping /= 5;
    if (done) break;
  }
  // A place where a observation is impossible is worth little, however well the tangents fit there.
  return cost + kUndefinedCost * std::count_if(depths.begin(), depths.end(), [](double depth) {
                  return depth > 0;
                });
}

template <typename Pose>
Vector9d InitializeObject(const Model& model, const History<Pose>& history, const Object& object) {
  const Observation& observation = history.observations[object.observations.front()];
  const Station station = Station::At<Pose>(history.poses[observation.pose].data(), model.mount);
  if (!observation.is_box) {
    const Rigid<double>& robot = station.world_from_robot;
    const Eigen::Vector3d center = robot.rotation * observation.value.head<3>() + robot.translation;
    return CenterShapeFromEllipsoid(Sphere(center, std::exp(object.size.log_mean)));
  }
  const View view{
      station.camera, observation.value, observation.sqrt_information, observation.truncated};
  return CenterShapeFromEllipsoid(BackProject(model.camera, {view}, object.size));
}

template <typename Pose>
Vector9d Reinitialize(const Model& model,
                      const History<Pose>& history,
                      const Object& object,
                      bool by_size) {
  const std::vector<View> views = ViewsOf(model, history, object);
  if (views.empty()) return object.center_shape;
  return CenterShapeFromEllipsoid(by_size ? BackProject(model.camera, views, object.size)
                                          : FitSphere(model.camera, views, object.size));
}

template <typename Pose>
void ReinitializeIfBetter(const Model& model, const History<Pose>& history, Object* object) {
  Vector9d here = object->center_shape;
  double cost = RefineObject(model, history, *object, kRefineIterations, &here);
  for (const bool by_size : {false, true}) {
    Vector9d there = Reinitialize(model, history, *object, by_size);
    const double other = RefineObject(model, history, *object, kRefineIterations, &there);
    if (!(other < cost)) continue;
    cost = other;
    here = there;
  }
  object->center_shape = here;
}

template <typename Pose>
Matrix9d InformationAt(const Model& model, const History<Pose>& history, const Object& object) {
  GaussianPrior sum;
  std::vector<double> unused;
  LinearizeAt(model, history, object, object.center_shape, &sum, &unused);
  return sum.H;
}

#define DQSLAM_INSTANTIATE(Pose)                                                                 \
  template double RefineObject<Pose>(                                                            \
      const Model&, const History<Pose>&, const Object&, int, Vector9d*);                        \
  template Vector9d InitializeObject<Pose>(const Model&, const History<Pose>&, const Object&);   \
  template Vector9d Reinitialize<Pose>(const Model&, const History<Pose>&, const Object&, bool); \
  template Matrix9d InformationAt<Pose>(const Model&, const History<Pose>&, const Object&);      \
  template void ReinitializeIfBetter<Pose>(const Model&, const History<Pose>&, Object*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
