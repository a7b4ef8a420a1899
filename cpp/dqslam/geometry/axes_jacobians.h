// Jacobians between the parameters of an ellipsoid and its semi-axes and orientation.  They convert
// covariances from one description to the other.
#pragma once

#include "dqslam/geometry/blocks.h"

namespace dqslam {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Jacobian of the logarithms of the semi-axes, descending, by the nine parameters.
Eigen::Matrix<double, 3, kLandmarkSize> LogSemiAxesJacobian(const Vector9d& ellipsoid);

/// Jacobian of the log-Cholesky shape by the logarithms of the semi-axes, in the order given, and
/// by rotations about each of them [rad].  Throws std::invalid_argument as EllipsoidFromAxes does.
Matrix6d ShapeFromAxesJacobian(const Eigen::Vector3d& semi_axes,
                               const Eigen::Vector4d& orientation_xyzw);

}  // namespace dqslam
