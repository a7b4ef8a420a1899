// Residuals and their derivatives by the tangent of the pose and the center_shape of the object.
//
// The edges' own are in edges.h; here they go on to the center_shape, in which the derivative of
// n^T S n is the products of n's entries.  Where the object is not strictly in front, the tangent
// residual takes the place of the box's, see costs/tangent.h.
#pragma once

#include "dqslam/geometry/box_derivatives.h"
#include "dqslam/online/history.h"
#include "dqslam/problem/graph.h"

namespace dqslam::online {

/// What all residuals share.
struct Model {
  Model(const Camera& camera, const ScenePriors& scene, double loss_scale)
      : camera(camera), mount(camera), scene(scene), loss_scale(loss_scale) {}
  Camera camera;
  Mount mount;
  ScenePriors scene;
  double loss_scale;  ///< of the Cauchy loss, sigmas of a whole box; 0 for least squares
};

template <typename Pose>
struct Linear {
  Eigen::Vector4d residual;
  Eigen::Matrix<double, 4, Pose::kTangentSize> by_pose;
  Eigen::Matrix<double, 4, 9> by_object;
  double chi_square;  ///< before the loss
  double cost;        ///< after the loss, which scales the rest
  double depth;       ///< of the tangent residual [m], 0 where it is the box's
};

/// Cost of a observation after the loss, and its chi-square before; with the residual that
/// Linearize() used, of that depth.  Infinite where it is the box's and the object is not strictly
/// in front.
template <typename Pose>
double CostOfObservation(const Model& model,
                         const Station& station,
                         const Observation& observation,
                         const Vector9d& center_shape,
                         double depth,
                         double* chi_square);

/// Which residual a box has where its object is in front; elsewhere it is the tangent's.
enum class Edges { kBox, kTangent };

/// The residual with derivatives.
template <typename Pose>
void Linearize(const Model& model,
               const Station& station,
               const Observation& observation,
               const Vector9d& center_shape,
               Edges edges,
               Linear<Pose>* linear);

/// Residual and derivatives by the tangents of both poses, (k, 2 k).
template <typename Pose>
struct LinearStep {
  static constexpr int k = Pose::kTangentSize;
  Eigen::Matrix<double, k, 1> residual;
  Eigen::Matrix<double, k, k> by_from, by_to;
};

template <typename Pose>
LinearStep<Pose> LinearizeStep(const typename History<Pose>::Step& step,
                               const double* from,
                               const double* to);

/// Half the squared distance of a step from its measurement, in sigmas.
template <typename Pose>
double CostOfStep(const typename History<Pose>::Step& step, const double* from, const double* to);

/// Adds the priors of an object to H and g and returns their cost; infinite where they fail.
double AddPriors(const Model& model,
                 const Object& object,
                 const Vector9d& center_shape,
                 GaussianPrior* sum);
double CostOfPriors(const Model& model, const Object& object, const Vector9d& center_shape);

/// Cost of a quadratic at a center_shape; its gradient there.
inline double CostOf(const GaussianPrior& quadratic, const Vector9d& center_shape) {
  const Vector9d d = center_shape - quadratic.origin;
  return quadratic.cost + quadratic.g.dot(d) + 0.5 * d.dot(quadratic.H * d);
}
inline Vector9d GradientOf(const GaussianPrior& quadratic, const Vector9d& center_shape) {
  return quadratic.g + quadratic.H * (center_shape - quadratic.origin);
}

/// Derivatives by a pose of the camera's known height: J (k), residual; cost 0 where it is unknown.
template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian);

}  // namespace dqslam::online
