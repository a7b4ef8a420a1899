// What the geometry must agree with, found without it: ellipsoids by their surface points, cameras
// as a rotation matrix written out by hand.  No code of cpp/dqslam except the Camera's numbers.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "dqslam/geometry/camera.h"

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
  Eigen::Vector3d semi_axes;         ///< meters
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

/// Direction of the unit sphere with the largest f, for an f with one maximum: dense samples, then
/// a pattern search around the best of them.
template <typename Function>
Eigen::Vector3d ArgMax(const Function& f) {
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
  return best;
}

/// The surface in the frame of a camera: center + axes d over the unit sphere.
struct Surface {
  Surface(const Viewpoint& view, const Ellipsoid& e)
      : center(view.ToCamera(e.center)),
        axes(view.rotation.transpose() * RotationMatrix(e.orientation_xyzw) *
             e.semi_axes.asDiagonal()) {}
  Eigen::Vector3d Point(const Eigen::Vector3d& d) const { return center + axes * d; }

  Eigen::Vector3d center;
  Eigen::Matrix3d axes;
};

/// Smallest depth of a surface point.
inline double NearestDepth(const Viewpoint& view, const Ellipsoid& ellipsoid) {
  const Surface surface(view, ellipsoid);
  const auto nearness = [&](const Eigen::Vector3d& d) { return -surface.Point(d).z(); };
  return -nearness(ArgMax(nearness));
}

/// Pixels of the surface points that project furthest out at each edge (u_min, v_min, u_max,
/// v_max), one a row; the ellipsoid must be in front.
inline Eigen::Matrix<double, 4, 2> ExtremePixels(const Camera& camera,
                                                 const Viewpoint& view,
                                                 const Ellipsoid& ellipsoid) {
  const Surface surface(view, ellipsoid);
  const auto pixel = [&](const Eigen::Vector3d& d) {
    const Eigen::Vector3d p = surface.Point(d);
    return Eigen::Vector2d(camera.fx * p.x() / p.z() + camera.cx,
                           camera.fy * p.y() / p.z() + camera.cy);
  };
  Eigen::Matrix<double, 4, 2> pixels;
  for (int edge = 0; edge < 4; ++edge) {
    const double outward = edge < 2 ? -1 : 1;
    pixels.row(edge) =
        pixel(ArgMax([&](const Eigen::Vector3d& d) { return outward * pixel(d)[edge % 2]; }));
  }
  return pixels;
}

/// Box of all projected surface points [px].
inline Eigen::Vector4d Box(const Camera& camera,
                           const Viewpoint& view,
                           const Ellipsoid& ellipsoid) {
  const Eigen::Matrix<double, 4, 2> pixels = ExtremePixels(camera, view, ellipsoid);
  return {pixels(0, 0), pixels(1, 1), pixels(2, 0), pixels(3, 1)};
}

}  // namespace dqslam::oracle
