// Residuals and their derivatives by the tangent of the pose and the center_shape of the object.
//
// Derivatives of a box's edges are in box_derivatives.h.  Here they are converted to derivatives by
// center_shape; the derivative of n^T S n by it is the products of n's entries.  If the object is
// not strictly in front, the tangent residual replaces the box residual, see costs/tangent.h.
#pragma once

#include "dqslam/online/history.h"

namespace dqslam::online {

template <typename Pose>
struct LinearizedObservation {
  Eigen::Vector4d residual;
  Eigen::Matrix<double, 4, Pose::kTangentSize> by_pose;
  Eigen::Matrix<double, 4, 9> by_object;
  double chi_square;  ///< before the loss
  double cost;        ///< after the loss, which also scales residual and derivatives
  double depth;       ///< of the tangent residual [m]; 0 for the box residual
};

/// Cost of an observation after the loss, and its chi-square before the loss.  `depth` selects the
/// residual that Linearize() used.  The cost is infinite for a box residual of an object that is
/// not strictly in front.
template <typename Pose>
double CostOfObservation(const Model& model,
                         const Station& station,
                         const Observation& observation,
                         const Vector9d& center_shape,
                         double depth,
                         double* chi_square);

/// Cost added to an observation whose object is not in front.  Such a state is bad even if the
/// tangents fit well.
inline constexpr double kUndefinedCost = 50;

/// The residual of a box whose object is in front.  Other boxes always have the tangent residual.
enum class EdgeResidual { kBox, kTangent };

/// Computes the residual with derivatives.
template <typename Pose>
void Linearize(const Model& model,
               const Station& station,
               const Observation& observation,
               const Vector9d& center_shape,
               EdgeResidual edges,
               LinearizedObservation<Pose>* linear);

/// Residual of a step and its derivatives by the tangents of both poses.
template <typename Pose>
struct LinearizedStep {
  static constexpr int k = Pose::kTangentSize;
  Eigen::Matrix<double, k, 1> residual;
  Eigen::Matrix<double, k, k> by_from, by_to;
};

template <typename Pose>
LinearizedStep<Pose> LinearizeStep(const typename History<Pose>::Step& step,
                                   const double* from,
                                   const double* to);

/// Half the squared distance of a step from its measurement, in sigmas.
template <typename Pose>
double CostOfStep(const typename History<Pose>::Step& step, const double* from, const double* to);

/// Adds the priors of an object to H and g and returns their cost, which is infinite if they fail.
double AddPriors(const Model& model,
                 const Object& object,
                 const Vector9d& center_shape,
                 GaussianPrior* sum);
double CostOfPriors(const Model& model, const Object& object, const Vector9d& center_shape);

/// Derivatives of the residual of the camera's known height by a pose.  Returns the residual, which
/// is 0 if the height is unknown.
template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian);

}  // namespace dqslam::online
