// Residuals and their derivatives by the tangent of the pose and the center_shape of the object.
//
// Those of a box's edges are in box_derivatives.h; here they go on to the center_shape, by which
// the derivative of n^T S n is the products of n's entries.  Where the object is not strictly in
// front, the tangent residual takes the place of the box's, see costs/tangent.h.
#pragma once

#include "dqslam/online/history.h"

namespace dqslam::online {

template <typename Pose>
struct LinearizedObservation {
  Eigen::Vector4d residual;
  Eigen::Matrix<double, 4, Pose::kTangentSize> by_pose;
  Eigen::Matrix<double, 4, 9> by_object;
  double chi_square;  ///< before the loss
  double cost;        ///< after the loss, which scales the rest
  double depth;       ///< of the tangent residual [m], 0 where it is the box's
};

/// Cost of an observation after the loss, and its chi-square before; with the residual that
/// Linearize() used, of that depth.  Infinite where it is the box's and the object is not strictly
/// in front.
template <typename Pose>
double CostOfObservation(const Model& model,
                         const Station& station,
                         const Observation& observation,
                         const Vector9d& center_shape,
                         double depth,
                         double* chi_square);

/// What an observation costs beside its tangent residual where its object is not in front: such a
/// place is worth little, however well the tangents fit there.
inline constexpr double kUndefinedCost = 50;

/// Which residual a box has where its object is in front; elsewhere it is the tangent's.
enum class EdgeResidual { kBox, kTangent };

/// The residual with derivatives.
template <typename Pose>
void Linearize(const Model& model,
               const Station& station,
               const Observation& observation,
               const Vector9d& center_shape,
               EdgeResidual edges,
               LinearizedObservation<Pose>* linear);

/// Residual and derivatives by the tangents of both poses, (k, 2 k).
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

/// Adds the priors of an object to H and g and returns their cost; infinite where they fail.
double AddPriors(const Model& model,
                 const Object& object,
                 const Vector9d& center_shape,
                 GaussianPrior* sum);
double CostOfPriors(const Model& model, const Object& object, const Vector9d& center_shape);

/// Derivatives by a pose of the camera's known height: J (k), residual; cost 0 where it is unknown.
template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian);

}  // namespace dqslam::online
