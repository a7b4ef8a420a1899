#include "dqslam/online/start.h"

#include <cmath>
#include <limits>

namespace dqslam::online {
namespace {

constexpr int kSettleIterations = 6;
// What a sight costs that the object cannot have: more than any that fits at all.
constexpr double kUndefinedCost = 50;

template <typename Pose>
std::vector<View> ViewsOf(const Model& model,
                          const History<Pose>& history,
                          const Object& object) {
  std::vector<View> views;
  for (const int row : object.sights) {
    const Sight& sight = history.sights[row];
    if (!sight.is_box) continue;
    const Stand stand = StandAt<Pose>(model, history.poses[sight.pose].data());
    views.push_back({stand.camera, sight.value, sight.sqrt_information, sight.truncated});
  }
  return views;
}

// Cost at a chart; with `sum`, its derivatives as well.
template <typename Pose>
double CostAt(const Model& model,
              const History<Pose>& history,
              const Object& object,
              const Vector9d& chart,
              Quadratic* sum) {
  double cost =
      sum ? AddPriors(model, object, chart, sum) : CostOfPriors(model, object, chart);
  for (const int row : object.sights) {
    const Sight& sight = history.sights[row];
    const Stand stand = StandAt<Pose>(model, history.poses[sight.pose].data());
    bool defined = false;
    double sight_cost = kUndefinedCost;
    if (sum) {
      Linear<Pose> linear;
      defined = Linearize<Pose>(model, stand, sight, chart, &linear);
      if (defined) {
        sum->H.noalias() += linear.by_object.transpose() * linear.by_object;
        sum->g += linear.by_object.transpose() * linear.residual;
        sight_cost = linear.cost;
      }
    } else {
      Eigen::Vector4d error;
      double loss, found;
      defined = ErrorOf(model, stand, sight, chart, &error, &found, &loss);
      if (defined) sight_cost = found;
    }
    cost += sight_cost;
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
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Quadratic sum;
    cost = CostAt(model, history, object, *chart, &sum);
    Matrix9d H = sum.H;
    H.diagonal() *= 1 + damping;
    const Vector9d step = -H.ldlt().solve(sum.g);
    Vector9d trial;
    const double after = step.allFinite() && Move(*chart, step, &trial)
                             ? CostAt(model, history, object, trial, nullptr)
                             : std::numeric_limits<double>::infinity();
    if (after < cost) {
      const bool done = cost - after < 1e-4 * cost;
      *chart = trial;
      cost = after;
      damping /= 5;
      if (done) break;
    } else {
      damping *= 10;
    }
  }
  return cost;
}

template <typename Pose>
Vector9d Birth(const Model& model, const History<Pose>& history, const Object& object) {
  const Sight& sight = history.sights[object.sights.front()];
  const Stand stand = StandAt<Pose>(model, history.poses[sight.pose].data());
  if (!sight.is_box) {
    const Rigid<double>& robot = stand.world_from_robot;
    const Eigen::Vector3d center = robot.rotation * sight.value.head<3>() + robot.translation;
    return ChartFromEllipsoid(Sphere(center, std::exp(object.size.log_mean)));
  }
  const View view{stand.camera, sight.value, sight.sqrt_information, sight.truncated};
  return ChartFromEllipsoid(BackProject(model.camera, {view}, object.size));
}

template <typename Pose>
void TryAgain(const Model& model, const History<Pose>& history, Object* object) {
  const std::vector<View> views = ViewsOf(model, history, *object);
  if (views.empty()) return;
  Vector9d here = object->chart;
  double cost = Settle(model, history, *object, kSettleIterations, &here);
  for (const Vector9d& ellipsoid : {FitSphere(model.camera, views, object->size),
                                    BackProject(model.camera, views, object->size)}) {
    Vector9d there = ChartFromEllipsoid(ellipsoid);
    const double other = Settle(model, history, *object, kSettleIterations, &there);
    if (!(other < cost)) continue;
    cost = other;
    here = there;
  }
  object->chart = here;
}

#define DQSLAM_INSTANTIATE(Pose)                                                             \
  template double Settle<Pose>(                                                              \
      const Model&, const History<Pose>&, const Object&, int, Vector9d*);                    \
  template Vector9d Birth<Pose>(const Model&, const History<Pose>&, const Object&);          \
  template void TryAgain<Pose>(const Model&, const History<Pose>&, Object*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
