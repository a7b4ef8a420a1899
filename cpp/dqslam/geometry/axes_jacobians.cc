#include "dqslam/geometry/axes_jacobians.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "dqslam/geometry/box_derivatives.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

// With S v = a^2 v and |v| = 1, d log a = v^T dS v / (2 a^2).
Eigen::Matrix<double, 3, kLandmarkSize> LogSemiAxesJacobian(const Vector9d& ellipsoid) {
  const Unpacked<EllipsoidModel> unpacked(ellipsoid.data());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(unpacked.surface.shape);  // ascending
  Eigen::Matrix<double, 3, kLandmarkSize> jacobian;
  for (int axis = 0; axis < 3; ++axis) {
    const double by_shape = 0.5 / eigen.eigenvalues()[2 - axis];
    jacobian.row(axis) = unpacked.Gradient(eigen.eigenvectors().col(2 - axis), 0, by_shape);
  }
  return jacobian;
}

// With S = R D R^T, growing turns D and turning by the angles w gives dS = R (W D - D W) R^T for
// the cross product W of w.  From S = L L^T follows dL = L T, T the lower triangle of L^-1 dS L^-T
// with half its diagonal.
Matrix6d ShapeFromAxesJacobian(const Eigen::Vector3d& semi_axes,
                               const Eigen::Vector4d& orientation_xyzw) {
  const Vector9d ellipsoid =
      EllipsoidFromAxes(Eigen::Vector3d::Zero(), semi_axes, orientation_xyzw);
  const Eigen::Matrix3d L = Unpacked<EllipsoidModel>(ellipsoid.data()).factor;
  const Eigen::Matrix3d R = Eigen::Quaterniond(orientation_xyzw.data()).toRotationMatrix();
  const Eigen::Vector3d squares = semi_axes.cwiseAbs2();
  Matrix6d jacobian;
  for (int column = 0; column < 6; ++column) {
    const int axis = column % 3, i = (axis + 1) % 3, j = (axis + 2) % 3;
    Eigen::Matrix3d by_axes = Eigen::Matrix3d::Zero();
    if (column < 3) {
      by_axes(axis, axis) = 2 * squares[axis];
    } else {
      by_axes(i, j) = by_axes(j, i) = squares[i] - squares[j];
    }
    const Eigen::Matrix3d half = L.triangularView<Eigen::Lower>().solve(R * by_axes);
    const Eigen::Matrix3d change =
        L.triangularView<Eigen::Lower>().solve((half * R.transpose()).transpose());
    Eigen::Matrix3d T = change.triangularView<Eigen::Lower>();
    T.diagonal() *= 0.5;
    const Eigen::Matrix3d dL = L * T;
    jacobian.col(column) << T.diagonal(), dL(1, 0), dL(2, 0), dL(2, 1);
  }
  return jacobian;
}

}  // namespace dqslam
