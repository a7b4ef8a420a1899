#include "dqslam/geometry/camera.h"

#include <cmath>
#include <stdexcept>
#include <string>

namespace dqslam {
namespace {

using Eigen::Vector2d;

Vector2d Distort(const Eigen::Matrix<double, 5, 1>& d, const Vector2d& p) {
  const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
  const double radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  return {x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x),
          y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y};
}

// Newton's method with a numerical Jacobian; starts at the distorted point.
bool Undistort(const Eigen::Matrix<double, 5, 1>& d, const Vector2d& distorted, Vector2d* point) {
  constexpr double kStep = 1e-7, kTolerance = 1e-12;
  *point = distorted;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Vector2d error = Distort(d, *point) - distorted;
    if (error.norm() < kTolerance) return true;
    Eigen::Matrix2d jacobian;
    for (int k = 0; k < 2; ++k) {
      const Vector2d h = kStep * Vector2d::Unit(k);
      jacobian.col(k) = (Distort(d, *point + h) - Distort(d, *point - h)) / (2 * kStep);
    }
    // A fold of the distortion polynomial: no unique inverse beyond it.
    if (jacobian.determinant() < 1e-3) return false;
    *point -= jacobian.inverse() * error;
  }
  return false;
}

// `each` successive points belong to one row of the table, which the exception names.
RowMatrix UndistortAll(const Camera& camera,
                       const RowMatrix& distorted,
                       const std::string& table,
                       Eigen::Index each) {
  if (!camera.HasDistortion()) return distorted;
  RowMatrix points(distorted.rows(), 2);
  for (Eigen::Index i = 0; i < distorted.rows(); ++i) {
    const Vector2d normalized((distorted(i, 0) - camera.cx) / camera.fx,
                              (distorted(i, 1) - camera.cy) / camera.fy);
    Vector2d point;
    if (!Undistort(camera.distortion, normalized, &point)) {
      throw std::invalid_argument(table + " row " + std::to_string(i / each) +
                                  ": the distortion cannot be inverted there");
    }
    points.row(i) << camera.fx * point.x() + camera.cx, camera.fy * point.y() + camera.cy;
  }
  return points;
}

// Middles of the edges of boxes (n, 4), (4 n, 2).
RowMatrix MiddlesOfEdges(const RowMatrix& boxes) {
  RowMatrix middles(4 * boxes.rows(), 2);
  for (Eigen::Index i = 0; i < boxes.rows(); ++i) {
    const auto box = boxes.row(i);
    const double u = 0.5 * (box[0] + box[2]), v = 0.5 * (box[1] + box[3]);
    middles.middleRows<4>(4 * i) << box[0], v, u, box[1], box[2], v, u, box[3];
  }
  return middles;
}

// Boxes (n, 4) whose edges run through points (4 n, 2).
RowMatrix FromMiddles(const RowMatrix& points) {
  RowMatrix boxes(points.rows() / 4, 4);
  for (Eigen::Index i = 0; i < points.rows(); ++i) boxes(i / 4, i % 4) = points(i, i % 2);
  return boxes;
}

}  // namespace

void Camera::Validate() const {
  const Eigen::Vector4d k(fx, fy, cx, cy);
  if (!k.allFinite() || !distortion.allFinite() || !robot_from_camera.allFinite()) {
    throw std::invalid_argument("camera: parameters must be finite");
  }
  if (fx <= 0 || fy <= 0) throw std::invalid_argument("camera: fx and fy must be positive");
  if (width <= 0 || height <= 0) {
    throw std::invalid_argument("camera: width and height must be positive");
  }
  if (std::abs(robot_from_camera.tail<4>().norm() - 1) > 1e-6) {
    throw std::invalid_argument("camera: robot_from_camera needs a unit quaternion");
  }
}

RowMatrix Camera::UndistortPoints(const RowMatrix& distorted) const {
  return UndistortAll(*this, distorted, "points", 1);
}

RowMatrix Camera::DistortPoints(const RowMatrix& undistorted) const {
  if (!HasDistortion()) return undistorted;
  RowMatrix points(undistorted.rows(), 2);
  for (Eigen::Index i = 0; i < undistorted.rows(); ++i) {
    const Vector2d point =
        Distort(distortion, {(undistorted(i, 0) - cx) / fx, (undistorted(i, 1) - cy) / fy});
    points.row(i) << fx * point.x() + cx, fy * point.y() + cy;
  }
  return points;
}

RowMatrix Camera::UndistortBoxes(const RowMatrix& distorted) const {
  if (!HasDistortion()) return distorted;
  return FromMiddles(UndistortAll(*this, MiddlesOfEdges(distorted), "boxes", 4));
}

RowMatrix Camera::DistortBoxes(const RowMatrix& undistorted) const {
  if (!HasDistortion()) return undistorted;
  RowMatrix boxes = FromMiddles(DistortPoints(MiddlesOfEdges(undistorted)));
  // An edge is undistorted at the middle of the recorded box, which is not that of the other: a
  // fixed point, which a few steps reach unless the lens is extreme.
  constexpr int kMaxIterations = 50;
  constexpr double kAccuracy = 1e-6;  // pixels
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const RowMatrix error = undistorted - UndistortBoxes(boxes);
    boxes += error;
    if (error.size() == 0 || error.cwiseAbs().maxCoeff() < kAccuracy) break;
  }
  return boxes;
}

}  // namespace dqslam
