// What the geometry must agree with, found without it: ellipsoids by their surface points, cameras
// as a rotation matrix written out by hand.  No code of cpp/dqslam except the Camera's numbers.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <limits>

#include "dqslam/camera.h"

namespace dqslam::oracle {

/// Rotation matrix of a unit quaternion x y z w, entry by entry.
inline Eigen::Matrix3d RotationMatrix(const Eigen::Vector4d& q) {
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  Eigen::Matrix3d R;
  R << 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),  //
      2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),   //
      2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y);
  return R;
}

struct Ellipsoid {
  Eigen::Vector3d center;
  Eigen::Vector3d semi_axes;         ///< metres
  Eigen::Vector4d orientation_xyzw;  ///< world_from_object

  /// Surface point in the direction d of the unit sphere.
  Eigen::Vector3d Point(const Eigen::Vector3d& d) const {
    return center + RotationMatrix(orientation_xyzw) * semi_axes.cwiseProduct(d);
  }
};

/// world_from_camera as rotation and position.
struct Viewpoint {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();

  Eigen::Vector3d ToCamera(const Eigen::Vector3d& in_world) const {
    return rotation.transpose() * (in_world - position);
  }
};

/// Stands at `position` and looks at `target`; `roll` [rad] turns it about its axis.
inline Viewpoint LookAt(const Eigen::Vector3d& position,
                        const Eigen::Vector3d& target,
                        double roll = 0) {
  const Eigen::Vector3d z = (target - position).normalized();
  const Eigen::Vector3d right = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  const Eigen::Vector3d down = z.cross(right);
  Viewpoint view;
  view.rotation << std::cos(roll) * right + std::sin(roll) * down,
      std::cos(roll) * down - std::sin(roll) * right, z;
  view.position = position;
  return view;
}

/// Largest value of f over the unit sphere, for an f with one maximum: dense samples, then a
/// pattern search around the best of them.
inline double Maximum(const std::function<double(const Eigen::Vector3d&)>& f) {
  constexpr int kSamples = 2000;
  Eigen::Vector3d best = Eigen::Vector3d::UnitX();
  double best_value = -std::numeric_limits<double>::infinity();
  const auto keep_if_better = [&](const Eigen::Vector3d& d) {
    const double value = f(d);
    if (!(value > best_value)) return false;
    best_value = value;
    best = d;
    return true;
  };
  for (int i = 0; i < kSamples; ++i) {  // Fibonacci sphere
    const double z = 1 - (2 * i + 1.0) / kSamples, angle = i * M_PI * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    keep_if_better({r * std::cos(angle), r * std::sin(angle), z});
  }
  for (double step = 0.05; step > 1e-9;) {
    const Eigen::Vector3d center = best, u = center.unitOrthogonal(), v = center.cross(u);
    bool moved = false;
    for (int i = 0; i < 8; ++i) {
      const double angle = i * M_PI / 4;
      moved |= keep_if_better(
          (center + step * (std::cos(angle) * u + std::sin(angle) * v)).normalized());
    }
    if (!moved) step /= 2;
  }
  return best_value;
}

/// Smallest depth of a surface point.
inline double NearestDepth(const Viewpoint& view, const Ellipsoid& ellipsoid) {
  return -Maximum([&](const Eigen::Vector3d& d) { return -view.ToCamera(ellipsoid.Point(d)).z(); });
}

/// Box of all projected surface points [px]; the ellipsoid must be in front.
inline Eigen::Vector4d Box(const Camera& camera,
                           const Viewpoint& view,
                           const Ellipsoid& ellipsoid) {
  const auto pixel = [&](const Eigen::Vector3d& d, int axis) {
    const Eigen::Vector3d p = view.ToCamera(ellipsoid.Point(d));
    return axis == 0 ? camera.fx * p.x() / p.z() + camera.cx
                     : camera.fy * p.y() / p.z() + camera.cy;
  };
  Eigen::Vector4d box;
  for (int axis = 0; axis < 2; ++axis) {
    box[axis] = -Maximum([&](const Eigen::Vector3d& d) { return -pixel(d, axis); });
    box[axis + 2] = Maximum([&](const Eigen::Vector3d& d) { return pixel(d, axis); });
  }
  return box;
}

}  // namespace dqslam::oracle
