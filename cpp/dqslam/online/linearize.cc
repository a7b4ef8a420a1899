#include "dqslam/online/linearize.h"

#include <ceres/jet.h>

#include <cmath>
#include <limits>

#include "dqslam/costs/odometry.h"
#include "dqslam/costs/scene_priors.h"
#include "dqslam/costs/size_prior.h"

namespace dqslam::online {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;

// The Cauchy loss of a squared norm s: cost and weight of the residual.
void Weigh(double loss_scale, double s, double* cost, double* loss) {
  if (loss_scale == 0) {
    *cost = 0.5 * s;
    *loss = 1;
    return;
  }
  const double c2 = loss_scale * loss_scale;
  *cost = 0.5 * c2 * std::log1p(s / c2);
  *loss = 1 / std::sqrt(1 + s / c2);
}

// Edges that only bound the object, as in prepared.h.
EdgeFlags OneSided(const Camera& camera,
                   const Sight& sight,
                   const Surface<double>& in_camera,
                   const Vector4d& predicted) {
  EdgeFlags one_sided = sight.truncated;
  if (!one_sided.any()) return one_sided;
  const Eigen::Matrix<double, 4, 2> points = TouchingPoints(in_camera, camera, predicted);
  for (int edge = 0; edge < kBoxSize; ++edge) {
    one_sided[edge] = one_sided[edge] || !camera.Shows(points(edge, 0), points(edge, 1));
  }
  return one_sided;
}

// Which edges have no error: those beyond the border of the image.
void BoxError(const Camera& camera,
              const Sight& sight,
              const Surface<double>& in_camera,
              const Vector4d& predicted,
              Vector4d* error) {
  *error = predicted - sight.value;
  if (sight.truncated.any()) {
    IgnoreBeyond(OneSided(camera, sight, in_camera, predicted), error);
  }
}

// Derivatives of focal (a n.dp + b n^T dS n), the camera's frame, for the edge of axis and normal
// n.
template <typename Pose>
void SetEdge(const Stand& stand,
             const Surface<double>& object,
             const Vector3d& q,
             int edge,
             const Vector3d& n,
             double a,
             double b,
             Linear<Pose>* linear) {
  const Eigen::Matrix3d& R = stand.world_from_robot.rotation;
  const Vector3d w = stand.camera.camera_from_world.transpose() * n;
  const Vector3d in_robot = R.transpose() * w;
  const Vector3d v = R.transpose() * (object.shape * w);
  SetTangent<Pose>(-a * in_robot, -(a * q + 2 * b * v).cross(in_robot), linear->by_pose.row(edge));
  linear->by_object.row(edge) << a * w.transpose(), b * w[0] * w[0], 2 * b * w[0] * w[1],
      2 * b * w[0] * w[2], b * w[1] * w[1], 2 * b * w[1] * w[2], b * w[2] * w[2];
}

struct Edge {
  int axis;
  double outward, focal, principal;
  Edge(const Camera& camera, int edge)
      : axis(edge % 2),
        outward(edge < 2 ? -1 : 1),
        focal(axis == 0 ? camera.fx : camera.fy),
        principal(axis == 0 ? camera.cx : camera.cy) {}
  Vector3d Normal(double pixel) const {
    Vector3d n = Vector3d::Zero();
    n[axis] = 1;
    n.z() = -(pixel - principal) / focal;
    return n;
  }
};

// The depth that turns metres into pixels, as in assembly.cc.
double TangentDepth(const Surface<double>& in_camera) {
  const double thickness = std::sqrt(std::max(in_camera.shape(2, 2), 1e-12));
  return std::max(in_camera.center.z(), 1.5 * thickness);
}

// Error by edge; false where it is undefined.
bool BoxOrTangentError(const Camera& camera,
                       const Sight& sight,
                       const Surface<double>& in_camera,
                       double depth,
                       Vector4d* predicted,
                       Vector4d* error) {
  if (depth == 0) {
    if (!ProjectToBox(in_camera, camera, predicted)) return false;
    BoxError(camera, sight, in_camera, *predicted, error);
    return true;
  }
  if (!TangentDistances(in_camera, camera, sight.value, depth, error)) return false;
  // Distances point outwards.
  for (int edge = 0; edge < kBoxSize; ++edge) {
    if (sight.truncated[edge] && (*error)[edge] > 0) (*error)[edge] = 0;
  }
  return true;
}

template <typename Pose>
void LinearizeBox(const Model& model,
                  const Stand& stand,
                  const Sight& sight,
                  const Surface<double>& object,
                  Edges edges,
                  Vector4d* error,
                  Linear<Pose>* linear) {
  const Camera& camera = model.camera;
  const Surface<double> in_camera = ToCamera(stand.camera, object);
  const Vector3d& p = in_camera.center;
  const Eigen::Matrix3d& S = in_camera.shape;
  const Rigid<double>& robot = stand.world_from_robot;
  const Vector3d q = robot.rotation.transpose() * (object.center - robot.translation);
  Vector4d predicted;
  linear->depth = 0;
  if (edges == Edges::kTangent ||
      !BoxOrTangentError(camera, sight, in_camera, 0, &predicted, error)) {
    linear->depth = TangentDepth(in_camera);
    BoxOrTangentError(camera, sight, in_camera, linear->depth, &predicted, error);
  }
  for (int row = 0; row < kBoxSize; ++row) {
    const Edge edge(camera, row);
    double a, b;
    Vector3d n;
    if (linear->depth == 0) {
      n = edge.Normal(predicted[row]);
      const double x = -n.z();
      const double e = (S(2, 2) - p.z() * p.z()) * x - (S(edge.axis, 2) - p[edge.axis] * p.z());
      a = edge.focal * n.dot(p) / e;
      b = -0.5 * edge.focal / e;
    } else {
      n = edge.Normal(sight.value[row]);
      a = edge.focal / linear->depth * edge.outward;
      b = edge.focal / linear->depth * 0.5 / std::sqrt(std::max(n.dot(S * n), 1e-18));
    }
    if (sight.truncated.any() && (*error)[row] == 0) a = b = 0;  // ignored, or without effect
    SetEdge<Pose>(stand, object, q, row, n, a, b, linear);
  }
}

// r = z - q, q = R^T (c - t).
template <typename Pose>
void LinearizePosition(const Stand& stand, const Surface<double>& object, Linear<Pose>* linear) {
  const Eigen::Matrix3d& R = stand.world_from_robot.rotation;
  const Vector3d q = R.transpose() * (object.center - stand.world_from_robot.translation);
  linear->by_pose.setZero();
  linear->by_object.setZero();
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d unit = Vector3d::Unit(axis);
    SetTangent<Pose>(unit, q.cross(unit), linear->by_pose.row(axis));
  }
  linear->by_object.template topLeftCorner<3, 3>() = -R.transpose();
}

}  // namespace

double CostOfSight(const Model& model,
                   const Stand& stand,
                   const Sight& sight,
                   const Vector9d& chart,
                   double depth,
                   double* chi_square) {
  const Surface<double> object = SurfaceOf(chart);
  Vector4d error = Vector4d::Zero(), predicted;
  *chi_square = std::numeric_limits<double>::infinity();
  if (!sight.is_box) {
    const Rigid<double>& robot = stand.world_from_robot;
    error.head<3>() =
        sight.value.head<3>() - robot.rotation.transpose() * (object.center - robot.translation);
  } else if (!BoxOrTangentError(
                 model.camera, sight, ToCamera(stand.camera, object), depth, &predicted, &error)) {
    return *chi_square;
  }
  *chi_square = (sight.sqrt_information * error).squaredNorm();
  double cost, loss;
  Weigh(sight.is_box ? model.loss_scale : 0, *chi_square, &cost, &loss);
  return cost;
}

template <typename Pose>
void Linearize(const Model& model,
               const Stand& stand,
               const Sight& sight,
               const Vector9d& chart,
               Edges edges,
               Linear<Pose>* linear) {
  const Surface<double> object = SurfaceOf(chart);
  Vector4d error = Vector4d::Zero();
  if (sight.is_box) {
    LinearizeBox<Pose>(model, stand, sight, object, edges, &error, linear);
  } else {
    const Rigid<double>& robot = stand.world_from_robot;
    error.head<3>() =
        sight.value.head<3>() - robot.rotation.transpose() * (object.center - robot.translation);
    linear->depth = 0;
    LinearizePosition<Pose>(stand, object, linear);
  }
  const Eigen::Matrix4d& W = sight.sqrt_information;
  linear->residual = W * error;
  double loss;
  Weigh(sight.is_box ? model.loss_scale : 0, linear->residual.squaredNorm(), &linear->cost, &loss);
  linear->residual *= loss;
  const Eigen::Matrix4d weight = loss * W;
  linear->by_pose = weight * linear->by_pose.eval();
  linear->by_object = weight * linear->by_object.eval();
}

template <typename Pose>
LinearStep<Pose> LinearizeStep(const typename History<Pose>::Step& step,
                               const double* from,
                               const double* to) {
  constexpr int k = Pose::kTangentSize;
  using Jet = ceres::Jet<double, 2 * k>;
  Jet origin[Pose::kSize], tangent[k], moved_from[Pose::kSize], moved_to[Pose::kSize], residual[k];
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < Pose::kSize; ++i) origin[i] = Jet((side == 0 ? from : to)[i]);
    for (int i = 0; i < k; ++i) tangent[i] = Jet(0, side * k + i);
    Plus<Pose>(origin, tangent, side == 0 ? moved_from : moved_to);
  }
  const OdometryCost<Pose> cost{{}, step.relative, step.sqrt_information};
  cost(moved_from, moved_to, residual);
  LinearStep<Pose> linear;
  for (int i = 0; i < k; ++i) {
    linear.residual[i] = residual[i].a;
    linear.by_from.row(i) = residual[i].v.template head<k>().transpose();
    linear.by_to.row(i) = residual[i].v.template tail<k>().transpose();
  }
  return linear;
}

template <typename Pose>
double CostOfStep(const typename History<Pose>::Step& step, const double* from, const double* to) {
  const OdometryCost<Pose> cost{{}, step.relative, step.sqrt_information};
  Eigen::Matrix<double, Pose::kTangentSize, 1> residual;
  cost(from, to, residual.data());
  return 0.5 * residual.squaredNorm();
}

namespace {

// Calls add(residuals, count) for every prior, on the scalar of the chart.
template <typename T, typename Add>
bool ForPriors(const Model& model, const Object& object, const T* chart, Add&& add) {
  T ellipsoid[9], residual[6];
  EllipsoidFromChart(chart, ellipsoid);
  const SizePriorCost size{{}, object.size.log_mean, object.size.log_sigma};
  if (!size(ellipsoid, residual)) return false;
  add(residual, 6);
  const ScenePriors& scene = model.scene;
  if (scene.upright_sigma > 0) {
    UprightCost{{}, scene.up, scene.upright_sigma}(ellipsoid, residual);
    add(residual, 3);
  }
  if (scene.support_sigma > 0) {
    SupportPlaneCost{{}, scene.up, scene.plane_offset, scene.support_sigma}(ellipsoid, residual);
    add(residual, 1);
  }
  return true;
}

}  // namespace

double AddPriors(const Model& model, const Object& object, const Vector9d& chart, Quadratic* sum) {
  using Jet = ceres::Jet<double, 9>;
  Jet at[9];
  for (int i = 0; i < 9; ++i) at[i] = Jet(chart[i], i);
  double cost = CostOf(object.map, chart);
  const bool defined = ForPriors(model, object, at, [&](const Jet* residual, int count) {
    for (int i = 0; i < count; ++i) {
      sum->H.noalias() += residual[i].v * residual[i].v.transpose();
      sum->g += residual[i].v * residual[i].a;
      cost += 0.5 * residual[i].a * residual[i].a;
    }
  });
  sum->H += object.map.H;
  sum->g += GradientOf(object.map, chart);
  return defined ? cost : std::numeric_limits<double>::infinity();
}

double CostOfPriors(const Model& model, const Object& object, const Vector9d& chart) {
  double cost = CostOf(object.map, chart);
  const auto add = [&](const double* residual, int count) {
    for (int i = 0; i < count; ++i) cost += 0.5 * residual[i] * residual[i];
  };
  const bool defined = ForPriors(model, object, chart.data(), add);
  return defined ? cost : std::numeric_limits<double>::infinity();
}

template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian) {
  constexpr int k = Pose::kTangentSize;
  using Jet = ceres::Jet<double, k>;
  const ScenePriors& scene = model.scene;
  Jet origin[Pose::kSize], tangent[k], moved[Pose::kSize], residual;
  for (int i = 0; i < Pose::kSize; ++i) origin[i] = Jet(pose[i]);
  for (int i = 0; i < k; ++i) tangent[i] = Jet(0, i);
  Plus<Pose>(origin, tangent, moved);
  const CameraHeightCost<Pose> cost{{},
                                    model.mount,
                                    scene.up,
                                    scene.plane_offset,
                                    scene.camera_height,
                                    scene.camera_height_sigma};
  cost(moved, &residual);
  *jacobian = residual.v;
  return residual.a;
}

#define DQSLAM_INSTANTIATE(Pose)                                                              \
  template void Linearize<Pose>(                                                              \
      const Model&, const Stand&, const Sight&, const Vector9d&, Edges, Linear<Pose>*);       \
  template LinearStep<Pose> LinearizeStep<Pose>(                                              \
      const History<Pose>::Step&, const double*, const double*);                              \
  template double CostOfStep<Pose>(const History<Pose>::Step&, const double*, const double*); \
  template double LinearizeHeight<Pose>(                                                      \
      const Model&, const double*, Eigen::Matrix<double, Pose::kTangentSize, 1>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
