// Residuals and their derivatives by the tangent of the pose and the chart of the object.
//
// The edges' own are in edges.h; here they go on to the chart, in which the derivative of n^T S n
// is the products of n's entries.  Where the object is not strictly in front, the tangent residual
// takes the place of the box's, see costs/tangent.h.
#pragma once

#include "dqslam/edges.h"
#include "dqslam/graph.h"
#include "dqslam/online/history.h"

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

/// Cost of a sight after the loss, and its chi-square before; with the residual that Linearize()
/// used, of that depth.  Infinite where it is the box's and the object is not strictly in front.
double CostOfSight(const Model& model,
                   const Station& station,
                   const Sight& sight,
                   const Vector9d& chart,
                   double depth,
                   double* chi_square);

/// Which residual a box has where its object is in front; elsewhere it is the tangent's.
enum class Edges { kBox, kTangent };

/// The residual with derivatives.
template <typename Pose>
void Linearize(const Model& model,
               const Station& station,
               const Sight& sight,
               const Vector9d& chart,
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
double AddPriors(const Model& model, const Object& object, const Vector9d& chart, Quadratic* sum);
double CostOfPriors(const Model& model, const Object& object, const Vector9d& chart);

/// Cost of a quadratic at a chart; its gradient there.
inline double CostOf(const Quadratic& quadratic, const Vector9d& chart) {
  const Vector9d d = chart - quadratic.origin;
  return quadratic.cost + quadratic.g.dot(d) + 0.5 * d.dot(quadratic.H * d);
}
inline Vector9d GradientOf(const Quadratic& quadratic, const Vector9d& chart) {
  return quadratic.g + quadratic.H * (chart - quadratic.origin);
}

/// Derivatives by a pose of the camera's known height: J (k), residual; cost 0 where it is unknown.
template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian);

}  // namespace dqslam::online
