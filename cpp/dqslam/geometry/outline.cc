#include "dqslam/geometry/outline.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace dqslam {

bool ProjectToOutline(const Surface<double>& in_camera,
                      const Camera& camera,
                      int points,
                      RowMatrix* outline) {
  if (!StrictlyInFront(in_camera)) return false;
  const Eigen::Vector3d& p = in_camera.center;
  const Eigen::Matrix3d dual = p * p.transpose() - in_camera.shape;
  const Eigen::Matrix3d conic = dual / dual(2, 2);  // now [c c^T - E, c; c^T, 1]
  const Eigen::Vector2d focal(camera.fx, camera.fy), principal(camera.cx, camera.cy);
  const Eigen::Vector2d center = conic.topRightCorner<2, 1>();
  const Eigen::Matrix2d ellipse = center * center.transpose() - conic.topLeftCorner<2, 2>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(focal.asDiagonal() * ellipse *
                                                             focal.asDiagonal());
  // A speck far away may round to less than nothing.
  const Eigen::Vector2d radii = eigen.eigenvalues().cwiseMax(0).cwiseSqrt();
  const Eigen::Matrix2d axes = eigen.eigenvectors() * radii.asDiagonal();
  const Eigen::Vector2d middle = focal.cwiseProduct(center) + principal;
  outline->resize(points, 2);
  for (int i = 0; i < points; ++i) {
    const double angle = 2 * M_PI * i / (points - 1);
    outline->row(i) = middle + axes * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  return true;
}

}  // namespace dqslam
