#include "dqslam/geometry/body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "dqslam/geometry/body_derivatives.h"

namespace dqslam {

TouchingLine FindTouchingLine(const Body<double>& in_camera, int axis, double outward) {
  constexpr int kMaxSteps = 30;
  const Eigen::Vector3d& c = in_camera.center;
  TouchingLine line{c[axis] / c.z(), c.z(), Eigen::Vector3d::Zero()};
  for (int step = 0; step < kMaxSteps; ++step) {
    const Eigen::Vector3d local =
        (in_camera.factor.row(axis) - line.slope * in_camera.factor.row(2)).transpose();
    const double distance = outward * (c[axis] - line.slope * c.z()) +
                            Width(in_camera.shape, in_camera.rounding, local, &line.u);
    line.depth = c.z() + outward * in_camera.factor.row(2).dot(line.u);
    const double change = distance / line.depth;
    line.slope += outward * change;
    if (std::abs(change) < 1e-13 * (1 + std::abs(line.slope))) break;
  }
  return line;
}

double TangentDepth(const Body<double>& in_camera) {
  const double thickness = Width(in_camera, Eigen::Vector3d(0, 0, 1));
  return std::max(in_camera.center.z(), 1.5 * std::max(thickness, 1e-6));
}

Eigen::Matrix<double, 4, 2> TouchingPoints(const Body<double>& in_camera,
                                           const Camera& camera,
                                           const Eigen::Vector4d&) {
  Eigen::Matrix<double, kBoxSize, 2> points;
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const double outward = edge < 2 ? -1 : 1;
    const TouchingLine line = FindTouchingLine(in_camera, edge % 2, outward);
    const Eigen::Vector3d point = in_camera.center + outward * (in_camera.factor * line.u);
    points.row(edge) << camera.fx * point.x() / point.z() + camera.cx,
        camera.fy * point.y() / point.z() + camera.cy;
  }
  return points;
}

// The second moment along an axis of half-length h is h^2 / 3 for a cuboid and along a cylinder,
// h^2 / 4 across a cylinder, and a^2 / 5 for an ellipsoid.
Surface<double> EquivalentEllipsoid(const Body<double>& body) {
  const double across = body.shape == Shape::kCuboid ? 5.0 / 3 : 5.0 / 4;
  const Eigen::Vector3d squares(across, across, 5.0 / 3);
  return {body.center, body.factor * squares.asDiagonal() * body.factor.transpose()};
}

Vector9d BodyParameters(const Eigen::Vector3d& center,
                        const Eigen::Vector3d& half_lengths,
                        const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  Vector9d parameters;
  parameters << center, half_lengths.array().log().matrix(), turn.angle() * turn.axis();
  return parameters;
}

// A rotation vector w + dw turns by J dw in the frame of the object, where J is the right Jacobian
//   I - (1 - cos t) / t^2 [w] + (t - sin t) / t^3 [w]^2,  t = |w|.
Unpacked<BodyModel>::Unpacked(const BodyModel& model, const double* parameters)
    : surface(model.Unpack(parameters)),
      half(Eigen::Map<const Eigen::Vector3d>(parameters + 3).array().exp()) {
  rotation = surface.factor * half.cwiseInverse().asDiagonal();
  const Eigen::Map<const Eigen::Vector3d> w(parameters + 6);
  const double t = w.norm();
  const double first = t < 1e-4 ? 0.5 : (1 - std::cos(t)) / (t * t);
  const double second = t < 1e-4 ? 1.0 / 6 : (t - std::sin(t)) / (t * t * t);
  Eigen::Matrix3d cross;
  cross << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  by_vector = Eigen::Matrix3d::Identity() - first * cross + second * cross * cross;
}

}  // namespace dqslam
