#include "dqslam/online/linearize.h"

#include <cmath>
#include <limits>

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

template <typename Pose>
void LinearizeBox(const Model& model,
                  const Stand& stand,
                  const Surface<double>& object,
                  const Surface<double>& in_camera,
                  const Vector4d& predicted,
                  Linear<Pose>* linear) {
  const Camera& camera = model.camera;
  const Eigen::Matrix3d& R = stand.world_from_robot.rotation;
  const Vector3d& p = in_camera.center;
  const Eigen::Matrix3d& S = in_camera.shape;
  const Vector3d q = R.transpose() * (object.center - stand.world_from_robot.translation);
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    const double x = (predicted[edge] - principal[axis]) / focal[axis];
    const double e = (S(2, 2) - p.z() * p.z()) * x - (S(axis, 2) - p[axis] * p.z());
    Vector3d n = Vector3d::Zero();
    n[axis] = 1;
    n.z() = -x;
    const double a = n.dot(p), scale = focal[axis] / e;
    const Vector3d in_world = stand.camera.camera_from_world.transpose() * n;
    const Vector3d in_robot = R.transpose() * in_world;
    const Vector3d v = R.transpose() * (object.shape * in_world);
    SetTangent<Pose>(-scale * a * in_robot,
                     scale * (v - a * q).cross(in_robot),
                     linear->by_pose.row(edge));
    const double half = -0.5 * scale;
    linear->by_object.row(edge) << scale * a * in_world.transpose(),
        half * in_world[0] * in_world[0], 2 * half * in_world[0] * in_world[1],
        2 * half * in_world[0] * in_world[2], half * in_world[1] * in_world[1],
        2 * half * in_world[1] * in_world[2], half * in_world[2] * in_world[2];
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

bool ErrorOf(const Model& model,
             const Stand& stand,
             const Sight& sight,
             const Vector9d& chart,
             Vector4d* whitened,
             double* cost,
             double* loss) {
  const Surface<double> object = SurfaceOf(chart);
  Vector4d error = Vector4d::Zero();
  if (sight.is_box) {
    const Surface<double> in_camera = ToCamera(stand.camera, object);
    Vector4d predicted;
    if (!ProjectToBox(in_camera, model.camera, &predicted)) return false;
    BoxError(model.camera, sight, in_camera, predicted, &error);
  } else {
    const Rigid<double>& robot = stand.world_from_robot;
    error.head<3>() = sight.value.head<3>() -
                      robot.rotation.transpose() * (object.center - robot.translation);
  }
  *whitened = sight.sqrt_information * error;
  Weigh(sight.is_box ? model.loss_scale : 0, whitened->squaredNorm(), cost, loss);
  return std::isfinite(*cost);
}

template <typename Pose>
bool Linearize(const Model& model,
               const Stand& stand,
               const Sight& sight,
               const Vector9d& chart,
               Linear<Pose>* linear) {
  const Surface<double> object = SurfaceOf(chart);
  Vector4d error = Vector4d::Zero();
  if (sight.is_box) {
    const Surface<double> in_camera = ToCamera(stand.camera, object);
    Vector4d predicted;
    if (!ProjectToBox(in_camera, model.camera, &predicted)) return false;
    BoxError(model.camera, sight, in_camera, predicted, &error);
    LinearizeBox<Pose>(model, stand, object, in_camera, predicted, linear);
    for (int edge = 0; sight.truncated.any() && edge < kBoxSize; ++edge) {
      if (error[edge] != 0) continue;  // ignored, or without effect
      linear->by_pose.row(edge).setZero();
      linear->by_object.row(edge).setZero();
    }
  } else {
    const Rigid<double>& robot = stand.world_from_robot;
    error.head<3>() = sight.value.head<3>() -
                      robot.rotation.transpose() * (object.center - robot.translation);
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
  return std::isfinite(linear->cost);
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

#define DQSLAM_INSTANTIATE(Pose)                                                            \
  template bool Linearize<Pose>(                                                            \
      const Model&, const Stand&, const Sight&, const Vector9d&, Linear<Pose>*);            \
  template LinearStep<Pose> LinearizeStep<Pose>(                                            \
      const History<Pose>::Step&, const double*, const double*);                            \
  template double CostOfStep<Pose>(const History<Pose>::Step&, const double*, const double*); \
  template double LinearizeHeight<Pose>(                                                    \
      const Model&, const double*, Eigen::Matrix<double, Pose::kTangentSize, 1>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
