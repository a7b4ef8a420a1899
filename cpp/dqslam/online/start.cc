#include "dqslam/online/start.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace dqslam::online {
namespace {

constexpr int kSettleIterations = 6;
// What a sight costs beside its tangent residual while its object is not in front.
constexpr double kUndefinedCost = 50;

template <typename Pose>
std::vector<View> ViewsOf(const Model& model, const History<Pose>& history, const Object& object) {
  std::vector<View> views;
  for (const int row : object.sights) {
    const Sight& sight = history.sights[row];
    if (!sight.is_box) continue;
    const Station station = Station::At<Pose>(history.poses[sight.pose].data(), model.mount);
    views.push_back({station.camera, sight.value, sight.sqrt_information, sight.truncated});
  }
  return views;
}

// Derivatives at a chart, and the residuals that were used.
template <typename Pose>
double LinearizeAt(const Model& model,
                   const History<Pose>& history,
                   const Object& object,
                   const Vector9d& chart,
                   Quadratic* sum,
                   std::vector<double>* depths) {
  double cost = AddPriors(model, object, chart, sum);
  depths->clear();
  Linear<Pose> linear;
  for (const int row : object.sights) {
    const Sight& sight = history.sights[row];
    const Station station = Station::At<Pose>(history.poses[sight.pose].data(), model.mount);
    Linearize<Pose>(model, station, sight, chart, Edges::kBox, &linear);
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
              const Vector9d& chart,
              const std::vector<double>& depths) {
  double cost = CostOfPriors(model, object, chart), unused;
  for (size_t i = 0; i < object.sights.size(); ++i) {
    const Sight& sight = history.sights[object.sights[i]];
    const Station station = Station::At<Pose>(history.poses[sight.pose].data(), model.mount);
    cost += CostOfSight(model, station, sight, chart, depths[i], &unused);
  }
  return cost;
}

}  // namespace

template <typename Pose>
double Settle(const Model& model,
              const History<Pose>& history,
              const Object& object,
              int iterations,
              Vector9d* chart) {
  double damping = 1e-3, cost = std::numeric_limits<double>::infinity();
  std::vector<double> depths;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Quadratic sum;
    cost = LinearizeAt(model, history, object, *chart, &sum, &depths);
    Matrix9d H = sum.H;
    H.diagonal() *= 1 + damping;
    const Vector9d step = -H.ldlt().solve(sum.g);
    Vector9d trial;
    const bool possible = step.allFinite() && Move(*chart, step, &trial);
    const double after = possible ? CostAt(model, history, object, trial, depths) : cost;
    if (!(after < cost)) {
      damping *= 10;
      continue;
    }
    const bool done = cost - after < 1e-4 * cost;
    *chart = trial;
    cost = after;
    damping /= 5;
    if (done) break;
  }
  // A place where a sight is impossible is worth little, however well the tangents fit there.
  return cost + kUndefinedCost * std::count_if(depths.begin(), depths.end(), [](double depth) {
                  return depth > 0;
                });
}

template <typename Pose>
Vector9d Birth(const Model& model, const History<Pose>& history, const Object& object) {
  const Sight& sight = history.sights[object.sights.front()];
  const Station station = Station::At<Pose>(history.poses[sight.pose].data(), model.mount);
  if (!sight.is_box) {
    const Rigid<double>& robot = station.world_from_robot;
    const Eigen::Vector3d center = robot.rotation * sight.value.head<3>() + robot.translation;
    return ChartFromEllipsoid(Sphere(center, std::exp(object.size.log_mean)));
  }
  const View view{station.camera, sight.value, sight.sqrt_information, sight.truncated};
  return ChartFromEllipsoid(BackProject(model.camera, {view}, object.size));
}

template <typename Pose>
Vector9d StartAgain(const Model& model,
                    const History<Pose>& history,
                    const Object& object,
                    bool by_size) {
  const std::vector<View> views = ViewsOf(model, history, object);
  if (views.empty()) return object.chart;
  return ChartFromEllipsoid(by_size ? BackProject(model.camera, views, object.size)
                                    : FitSphere(model.camera, views, object.size));
}

template <typename Pose>
void TryAgain(const Model& model, const History<Pose>& history, Object* object) {
  Vector9d here = object->chart;
  double cost = Settle(model, history, *object, kSettleIterations, &here);
  for (const bool by_size : {false, true}) {
    Vector9d there = StartAgain(model, history, *object, by_size);
    const double other = Settle(model, history, *object, kSettleIterations, &there);
    if (!(other < cost)) continue;
    cost = other;
    here = there;
  }
  object->chart = here;
}

template <typename Pose>
Matrix9d InformationAt(const Model& model, const History<Pose>& history, const Object& object) {
  Quadratic sum;
  std::vector<double> unused;
  LinearizeAt(model, history, object, object.chart, &sum, &unused);
  return sum.H;
}

#define DQSLAM_INSTANTIATE(Pose)                                                                   \
  template double Settle<Pose>(const Model&, const History<Pose>&, const Object&, int, Vector9d*); \
  template Vector9d Birth<Pose>(const Model&, const History<Pose>&, const Object&);                \
  template Vector9d StartAgain<Pose>(const Model&, const History<Pose>&, const Object&, bool);     \
  template Matrix9d InformationAt<Pose>(const Model&, const History<Pose>&, const Object&);        \
  template void TryAgain<Pose>(const Model&, const History<Pose>&, Object*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
