#include "dqslam/geometry/ellipsoid.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dqslam {

double TangentDepth(const Surface<double>& in_camera) {
  const double thickness = std::sqrt(std::max(in_camera.shape(2, 2), 1e-12));
  return std::max(in_camera.center.z(), 1.5 * thickness);
}

Eigen::Matrix<double, 4, 2> TouchingPoints(const Surface<double>& in_camera,
                                           const Camera& camera,
                                           const Eigen::Vector4d& box) {
  const Eigen::Vector3d& p = in_camera.center;
  const Eigen::Matrix3d conic = p * p.transpose() - in_camera.shape;  // dual, normalized
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  Eigen::Matrix<double, 4, 2> points;
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    Eigen::Vector3d line = Eigen::Vector3d::Zero();
    line[axis] = 1;
    line.z() = -(box[edge] - principal[axis]) / focal[axis];
    const Eigen::Vector3d pole = conic * line;
    points.row(edge) << camera.fx * pole.x() / pole.z() + camera.cx,
        camera.fy * pole.y() / pole.z() + camera.cy;
  }
  return points;
}

Vector9d DualQuadricFromSurface(const Surface<double>& surface) {
  const Eigen::Vector3d& c = surface.center;
  const Eigen::Matrix3d A = c * c.transpose() - surface.shape;
  Vector9d q;
  q << A(0, 0), A(0, 1), A(0, 2), c[0], A(1, 1), A(1, 2), c[1], A(2, 2), c[2];
  return q;
}

Vector9d EllipsoidFromSurface(const Surface<double>& surface) {
  const Eigen::LLT<Eigen::Matrix3d> cholesky(surface.shape);
  if (!surface.center.allFinite() || !surface.shape.allFinite() ||
      cholesky.info() != Eigen::Success) {
    throw std::invalid_argument(
        "not an ellipsoid: the shape c c^T - Q*_33 must be positive definite");
  }
  const Eigen::Matrix3d L = cholesky.matrixL();
  Vector9d e;
  e << surface.center, std::log(L(0, 0)), std::log(L(1, 1)), std::log(L(2, 2)), L(1, 0), L(2, 0),
      L(2, 1);
  return e;
}

Vector9d DualQuadricFromEllipsoid(const Vector9d& ellipsoid) {
  return DualQuadricFromSurface(EllipsoidModel::Unpack(ellipsoid.data()));
}

Vector9d EllipsoidFromDualQuadric(const Vector9d& quadric) {
  return EllipsoidFromSurface(DualQuadricModel::Unpack(quadric.data()));
}

Eigen::Matrix4d DualQuadricMatrix(const Vector9d& q) {
  Eigen::Matrix4d Q;
  Q << q[0], q[1], q[2], q[3], q[1], q[4], q[5], q[6], q[2], q[5], q[7], q[8], q[3], q[6], q[8], 1;
  return Q;
}

Vector9d EllipsoidFromAxes(const Eigen::Vector3d& center,
                           const Eigen::Vector3d& semi_axes,
                           const Eigen::Vector4d& orientation_xyzw) {
  if (!semi_axes.allFinite() || (semi_axes.array() <= 0).any()) {
    throw std::invalid_argument("semi_axes must be positive and finite");
  }
  if (!orientation_xyzw.allFinite() || std::abs(orientation_xyzw.norm() - 1) > 1e-6) {
    throw std::invalid_argument("orientation_xyzw must be a unit quaternion");
  }
  const Eigen::Matrix3d R = Eigen::Quaterniond(orientation_xyzw.data()).toRotationMatrix();
  const Eigen::Vector3d squared = semi_axes.cwiseAbs2();
  return EllipsoidFromSurface({center, R * squared.asDiagonal() * R.transpose()});
}

EllipsoidAxes AxesFromEllipsoid(const Vector9d& ellipsoid) {
  const Surface<double> surface = EllipsoidModel::Unpack(ellipsoid.data());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(surface.shape);  // ascending
  Eigen::Matrix3d R = eigen.eigenvectors().rowwise().reverse();
  if (R.determinant() < 0) R.col(2) *= -1;
  return {surface.center,
          eigen.eigenvalues().reverse().cwiseMax(0).cwiseSqrt(),
          Eigen::Quaterniond(R).normalized().coeffs()};
}

Vector9d Sphere(const Eigen::Vector3d& center, double radius) {
  Vector9d e = Vector9d::Zero();
  e.head<3>() = center;
  e.segment<3>(3).setConstant(std::log(radius));
  return e;
}

}  // namespace dqslam
