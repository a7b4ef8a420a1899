#include "dqslam/online/linearize.h"

#include <cmath>
#include <limits>

#include "dqslam/costs/odometry.h"
#include "dqslam/costs/scene_priors.h"
#include "dqslam/costs/size_prior.h"
#include "dqslam/geometry/jets.h"

namespace dqslam {

struct CenterShapeModel;

// For ByPoseAndLandmark(): derivatives by the center_shape instead of a landmark's parameters.
template <>
struct Unpacked<CenterShapeModel> {
  explicit Unpacked(const Vector9d& center_shape) : surface(SurfaceOf(center_shape)) {}
  Vector9d Gradient(const Eigen::Vector3d& m, double by_center, double by_shape) const {
    const Eigen::Vector3d b = by_shape * m;
    Vector9d gradient;
    gradient << by_center * m, b[0] * m[0], 2 * b[0] * m[1], 2 * b[0] * m[2], b[1] * m[1],
        2 * b[1] * m[2], b[2] * m[2];
    return gradient;
  }
  Surface<double> surface;
};

namespace online {
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

// Error by edge of the box's residual where `depth` is 0, else of the tangents', with derivatives
// unless `edges` is null; false where it is undefined.
bool EdgeErrors(const Camera& camera,
                const Observation& observation,
                const Surface<double>& in_camera,
                double depth,
                Vector4d* error,
                EdgeDerivatives* edges) {
  const auto ignore = [&](const EdgeFlags& one_sided, const double (&outward)[kBoxSize]) {
    edges ? IgnoreBeyond(one_sided, outward, error, edges)
          : IgnoreBeyond(one_sided, error, outward);
  };
  if (depth == 0) {
    Vector4d box;
    const bool is_defined = edges ? DifferentiateBox(in_camera, camera, &box, edges)
                                  : ProjectToBox(in_camera, camera, &box);
    if (!is_defined) return false;
    *error = box - observation.value;
    if (observation.truncated.any())
      ignore(OneSidedEdges(observation.truncated, camera, in_camera, box), kBoxOutward);
    return true;
  }
  const Vector4d& box = observation.value;
  const bool is_defined = edges ? DifferentiateTangents(in_camera, camera, box, depth, error, edges)
                                : TangentDistances(in_camera, camera, box, depth, error);
  if (is_defined) ignore(observation.truncated, kTangentOutward);
  return is_defined;
}

// Returns the error by edge, and fills all of `linear` that the loss has no part in.
template <typename Pose>
Vector4d LinearizeBox(const Model& model,
                      const Station& station,
                      const Observation& observation,
                      const Unpacked<CenterShapeModel>& object,
                      EdgeResidual residual,
                      LinearizedObservation<Pose>* linear) {
  const Surface<double> in_camera = ToCamera(station.camera, object.surface);
  Vector4d error;
  EdgeDerivatives edges;
  linear->depth = 0;
  if (residual == EdgeResidual::kTangent ||
      !EdgeErrors(model.camera, observation, in_camera, 0, &error, &edges)) {
    linear->depth = TangentDepth(in_camera);
    if (!EdgeErrors(model.camera, observation, in_camera, linear->depth, &error, &edges)) {
      // A shape that rounding has flattened: CostOfObservation() is infinite there.
      linear->by_pose.setZero();
      linear->by_object.setZero();
      return Vector4d::Zero();
    }
  }
  ByPoseAndLandmark<Pose>(
      edges, station, model.mount, object, &linear->by_pose, &linear->by_object);
  return error;
}

// r = z - q, q = R^T (c - t).
Vector4d PositionError(const Station& station,
                       const Observation& observation,
                       const Vector3d& center) {
  const Rigid<double>& robot = station.world_from_robot;
  Vector4d error = Vector4d::Zero();
  error.head<3>() =
      observation.value.head<3>() - robot.rotation.transpose() * (center - robot.translation);
  return error;
}

template <typename Pose>
Vector4d LinearizePosition(const Station& station,
                           const Observation& observation,
                           const Vector3d& center,
                           LinearizedObservation<Pose>* linear) {
  const Vector4d error = PositionError(station, observation, center);
  const Eigen::Matrix3d& R = station.world_from_robot.rotation;
  const Vector3d q = observation.value.head<3>() - error.head<3>();
  linear->depth = 0;
  linear->by_pose.setZero();
  linear->by_object.setZero();
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d unit = Vector3d::Unit(axis);
    const Vector3d turn = q.cross(unit);
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      linear->by_pose.row(axis) << unit.x(), unit.y(), turn.z();
    } else {
      linear->by_pose.row(axis) << unit.transpose(), turn.transpose();
    }
  }
  linear->by_object.template topLeftCorner<3, 3>() = -R.transpose();
  return error;
}

}  // namespace

double CostOfObservation(const Model& model,
                         const Station& station,
                         const Observation& observation,
                         const Vector9d& center_shape,
                         double depth,
                         double* chi_square) {
  const Surface<double> object = SurfaceOf(center_shape);
  Vector4d error;
  *chi_square = std::numeric_limits<double>::infinity();
  if (!observation.is_box) {
    error = PositionError(station, observation, object.center);
  } else if (!EdgeErrors(model.camera,
                         observation,
                         ToCamera(station.camera, object),
                         depth,
                         &error,
                         nullptr)) {
    return *chi_square;
  }
  *chi_square = (observation.sqrt_information * error).squaredNorm();
  double cost, loss;
  Weigh(observation.is_box ? model.loss_scale : 0, *chi_square, &cost, &loss);
  return cost;
}

template <typename Pose>
void Linearize(const Model& model,
               const Station& station,
               const Observation& observation,
               const Vector9d& center_shape,
               EdgeResidual edges,
               LinearizedObservation<Pose>* linear) {
  const Unpacked<CenterShapeModel> object(center_shape);
  const Eigen::Matrix4d& W = observation.sqrt_information;
  linear->residual =
      W * (observation.is_box
               ? LinearizeBox(model, station, observation, object, edges, linear)
               : LinearizePosition(station, observation, object.surface.center, linear));
  linear->chi_square = linear->residual.squaredNorm();
  double loss;
  Weigh(observation.is_box ? model.loss_scale : 0, linear->chi_square, &linear->cost, &loss);
  linear->residual *= loss;
  const Eigen::Matrix4d weight = loss * W;
  linear->by_pose = weight * linear->by_pose.eval();
  linear->by_object = weight * linear->by_object.eval();
}

template <typename Pose>
LinearizedStep<Pose> LinearizeStep(const typename History<Pose>::Step& step,
                                   const double* from,
                                   const double* to) {
  constexpr int k = Pose::kTangentSize;
  using Jet = ceres::Jet<double, 2 * k>;
  Jet moved_from[Pose::kSize], moved_to[Pose::kSize], residual[k];
  PoseJets<Pose>(from, 0, moved_from);
  PoseJets<Pose>(to, k, moved_to);
  const OdometryCost<Pose> cost{{}, step.relative, step.sqrt_information};
  cost(moved_from, moved_to, residual);
  LinearizedStep<Pose> linear;
  Eigen::Matrix<double, k, 2 * k> jacobian;
  SplitJets(residual, &linear.residual, &jacobian);
  linear.by_from = jacobian.template leftCols<k>();
  linear.by_to = jacobian.template rightCols<k>();
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

// Calls add(residuals, count) for every prior, on the scalar of the center_shape.
template <typename T, typename Add>
bool ForPriors(const Model& model, const Object& object, const T* center_shape, Add&& add) {
  T ellipsoid[9], residual[6];
  EllipsoidFromCenterShape(center_shape, ellipsoid);
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

double AddPriors(const Model& model,
                 const Object& object,
                 const Vector9d& center_shape,
                 GaussianPrior* sum) {
  using Jet = ceres::Jet<double, 9>;
  Jet at[9];
  PlainJets<9>(center_shape.data(), 0, at);
  double cost = object.map.CostAt(center_shape);
  const bool defined = ForPriors(model, object, at, [&](const Jet* residual, int count) {
    for (int i = 0; i < count; ++i) {
      sum->H.noalias() += residual[i].v * residual[i].v.transpose();
      sum->g += residual[i].v * residual[i].a;
      cost += 0.5 * residual[i].a * residual[i].a;
    }
  });
  sum->H += object.map.H;
  sum->g += object.map.GradientAt(center_shape);
  return defined ? cost : std::numeric_limits<double>::infinity();
}

double CostOfPriors(const Model& model, const Object& object, const Vector9d& center_shape) {
  double cost = object.map.CostAt(center_shape);
  const auto add = [&](const double* residual, int count) {
    for (int i = 0; i < count; ++i) cost += 0.5 * residual[i] * residual[i];
  };
  const bool defined = ForPriors(model, object, center_shape.data(), add);
  return defined ? cost : std::numeric_limits<double>::infinity();
}

template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian) {
  const ScenePriors& scene = model.scene;
  ceres::Jet<double, Pose::kTangentSize> moved[Pose::kSize], residual;
  PoseJets<Pose>(pose, 0, moved);
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
  template void Linearize<Pose>(const Model&,                                                 \
                                const Station&,                                               \
                                const Observation&,                                           \
                                const Vector9d&,                                              \
                                EdgeResidual,                                                 \
                                LinearizedObservation<Pose>*);                                \
  template LinearizedStep<Pose> LinearizeStep<Pose>(                                          \
      const History<Pose>::Step&, const double*, const double*);                              \
  template double CostOfStep<Pose>(const History<Pose>::Step&, const double*, const double*); \
  template double LinearizeHeight<Pose>(                                                      \
      const Model&, const double*, Eigen::Matrix<double, Pose::kTangentSize, 1>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace online
}  // namespace dqslam
