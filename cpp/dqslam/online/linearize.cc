#include "dqslam/online/linearize.h"

#include <cmath>
#include <limits>

#include "dqslam/geometry/jets.h"
#include "dqslam/geometry/outline.h"
#include "dqslam/solver/terms.h"

namespace dqslam {

// A landmark model for costs of the center; a surface for ByPoseAndLandmark().
struct CenterShapeModel {
  template <typename T>
  static Surface<T> Unpack(const T* center_shape) {
    return {Vector3<T>(center_shape[0], center_shape[1], center_shape[2]), ShapeOf(center_shape)};
  }
};

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

// Edges of an observation that count on one side only: of the tangents (depth > 0) those that the
// image cut, of a box also those that the object touches outside the image.
EdgeFlags OneSided(const Camera& camera,
                   const Observation& observation,
                   const Surface<double>& in_camera,
                   double depth) {
  Vector4d predicted;
  if (depth > 0 || !observation.truncated.any() || !ProjectToBox(in_camera, camera, &predicted)) {
    return observation.truncated;
  }
  return OneSidedEdges(observation.truncated, camera, in_camera, predicted);
}

// Error by edge of the box's residual where `depth` is 0, else of the tangents', with derivatives
// where they are asked for; false where it is undefined.
template <bool kDerivatives>
bool ErrorsOf(const Camera& camera,
              const Observation& observation,
              const Surface<double>& in_camera,
              double depth,
              Vector4d* error,
              EdgeDerivatives* edges) {
  const EdgeFlags one_sided = OneSided(camera, observation, in_camera, depth);
  return EdgeErrors<kDerivatives>(
      in_camera, camera, observation.value, depth, one_sided, error, edges);
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
      !ErrorsOf<true>(model.camera, observation, in_camera, 0, &error, &edges)) {
    linear->depth = TangentDepth(in_camera);
    if (!ErrorsOf<true>(model.camera, observation, in_camera, linear->depth, &error, &edges)) {
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

// Calls visit(cost) with the cost of a measurement that is no box, and returns what that returns.
template <typename Pose, typename Visit>
auto VisitMeasurement(const Observation& observation, Visit&& visit) {
  return VisitMeasurementKind<Pose, CenterShapeModel>(observation.kind, [&](auto tag) {
    using Cost = typename decltype(tag)::Cost;
    constexpr int m = Cost::kResidualSize;
    return visit(
        Cost{{}, observation.value.head<m>(), observation.SqrtInformation().topLeftCorner<m, m>()});
  });
}

// Fills all of `linear`; where the measurement is undefined, CostOfObservation() is infinite.
template <typename Pose>
void LinearizeMeasurement(const Station& station,
                          const Observation& observation,
                          const Vector9d& center_shape,
                          LinearizedObservation<Pose>* linear) {
  linear->depth = 0;
  linear->residual.setZero();
  linear->by_pose.setZero();
  linear->by_object.setZero();
  VisitMeasurement<Pose>(observation, [&](const auto& cost) {
    constexpr int k = Pose::kTangentSize, m = std::decay_t<decltype(cost)>::kResidualSize;
    Eigen::Matrix<double, m, 1> residual;
    Eigen::Matrix<double, m, k + kLandmarkSize> jacobian;
    if (!Differentiate(cost,
                       &residual,
                       &jacobian,
                       PoseParameters<Pose>{station.pose},
                       ObjectParameters{center_shape.data()})) {
      return;
    }
    linear->residual.template head<m>() = residual;
    linear->by_pose.template topRows<m>() = jacobian.template leftCols<k>();
    linear->by_object.template topRows<m>() = jacobian.template rightCols<kLandmarkSize>();
  });
  linear->chi_square = linear->residual.squaredNorm();
  linear->cost = 0.5 * linear->chi_square;
}

}  // namespace

template <typename Pose>
double CostOfObservation(const Model& model,
                         const Station& station,
                         const Observation& observation,
                         const Vector9d& center_shape,
                         double depth,
                         double* chi_square) {
  *chi_square = std::numeric_limits<double>::infinity();
  if (!observation.IsBox()) {
    const bool defined = VisitMeasurement<Pose>(observation, [&](const auto& cost) {
      Eigen::Matrix<double, std::decay_t<decltype(cost)>::kResidualSize, 1> residual;
      if (!cost(station.pose, center_shape.data(), residual.data())) return false;
      *chi_square = residual.squaredNorm();
      return true;
    });
    return defined ? 0.5 * *chi_square : *chi_square;
  }
  Vector4d error;
  const Surface<double> in_camera = ToCamera(station.camera, SurfaceOf(center_shape));
  if (!ErrorsOf<false>(model.camera, observation, in_camera, depth, &error, nullptr)) {
    return *chi_square;
  }
  *chi_square = (observation.SqrtInformation() * error).squaredNorm();
  double cost, loss;
  Weigh(model.loss_scale, *chi_square, &cost, &loss);
  return cost;
}

template <typename Pose>
void Linearize(const Model& model,
               const Station& station,
               const Observation& observation,
               const Vector9d& center_shape,
               EdgeResidual edges,
               LinearizedObservation<Pose>* linear) {
  if (!observation.IsBox()) {
    LinearizeMeasurement(station, observation, center_shape, linear);
    return;
  }
  const Unpacked<CenterShapeModel> object(center_shape);
  const Eigen::Matrix4d W = observation.SqrtInformation();
  linear->residual = W * LinearizeBox(model, station, observation, object, edges, linear);
  linear->chi_square = linear->residual.squaredNorm();
  double loss;
  Weigh(model.loss_scale, linear->chi_square, &linear->cost, &loss);
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
  LinearizedStep<Pose> linear;
  Eigen::Matrix<double, k, 2 * k> jacobian;
  Differentiate(OdometryCost<Pose>{{}, step.relative, step.sqrt_information},
                &linear.residual,
                &jacobian,
                PoseParameters<Pose>{from},
                PoseParameters<Pose>{to});
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

// A prior on an ellipsoid as a cost of its center and shape.
template <typename Prior>
struct OfCenterShape {
  static constexpr int kResidualSize = Prior::kResidualSize;
  const Prior& prior;

  template <typename T>
  bool operator()(const T* center_shape, T* residual) const {
    T ellipsoid[kLandmarkSize];
    EllipsoidFromCenterShape(center_shape, ellipsoid);
    return prior(ellipsoid, residual);
  }
};

// Calls visit(cost) with each prior of an object; false where a call returns false.
template <typename Visit>
bool VisitPriors(const Model& model, const Object& object, Visit&& visit) {
  return VisitObjectPriors(
      object.size.log_mean, object.size.log_sigma, model.scene, [&](const auto& prior) {
        return visit(OfCenterShape<std::decay_t<decltype(prior)>>{prior});
      });
}

}  // namespace

double AddPriors(const Model& model,
                 const Object& object,
                 const Vector9d& center_shape,
                 GaussianPrior* sum) {
  double cost = object.map.CostAt(center_shape);
  const bool defined = VisitPriors(model, object, [&](const auto& prior) {
    constexpr int m = std::decay_t<decltype(prior)>::kResidualSize;
    Eigen::Matrix<double, m, 1> residual;
    Eigen::Matrix<double, m, kLandmarkSize> jacobian;
    const ObjectParameters parameters{center_shape.data()};
    if (!Differentiate(prior, &residual, &jacobian, parameters)) return false;
    sum->H.noalias() += jacobian.transpose() * jacobian;
    sum->g.noalias() += jacobian.transpose() * residual;
    cost += 0.5 * residual.squaredNorm();
    return true;
  });
  sum->H += object.map.H;
  sum->g += object.map.GradientAt(center_shape);
  return defined ? cost : std::numeric_limits<double>::infinity();
}

double CostOfPriors(const Model& model, const Object& object, const Vector9d& center_shape) {
  double cost = object.map.CostAt(center_shape);
  const bool defined = VisitPriors(model, object, [&](const auto& prior) {
    Eigen::Matrix<double, std::decay_t<decltype(prior)>::kResidualSize, 1> residual;
    if (!prior(center_shape.data(), residual.data())) return false;
    cost += 0.5 * residual.squaredNorm();
    return true;
  });
  return defined ? cost : std::numeric_limits<double>::infinity();
}

template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian) {
  Eigen::Matrix<double, 1, 1> residual = Eigen::Matrix<double, 1, 1>::Zero();
  VisitPosePriors<Pose>(model.mount, model.scene, [&](const auto& cost) {
    Eigen::Matrix<double, 1, Pose::kTangentSize> row;
    const bool defined = Differentiate(cost, &residual, &row, PoseParameters<Pose>{pose});
    *jacobian = row.transpose();
    return defined;
  });
  return residual[0];
}

#define DQSLAM_INSTANTIATE(Pose)                                                              \
  template double CostOfObservation<Pose>(                                                    \
      const Model&, const Station&, const Observation&, const Vector9d&, double, double*);    \
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
