// Measured distance to an object's center, as a radio tag gives it:  r = (|c - t| - range) / sigma.
//
// Blocks: world_from_robot [d], landmark [9].  Residual: [1], in sigmas.
// Returns false within 1 mm of the center, where the distance has no derivative.
#pragma once

#include <cmath>

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

inline constexpr double kMinRange = 1e-3;  ///< meters

template <typename Pose, typename Landmark>
struct RangeCost : AutoDiffCost<RangeCost<Pose, Landmark>, 1, Pose::kSize, kLandmarkSize> {
  double range;  ///< meters
  double sigma;  ///< meters

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    using std::sqrt;
    const Vector3<T> robot = Pose::WorldFromRobot(pose).translation;
    const T squared = (Landmark::Unpack(landmark).center - robot).squaredNorm();
    if (!(squared > T(kMinRange * kMinRange))) return false;
    residual[0] = (sqrt(squared) - T(range)) / T(sigma);
    return true;
  }
};

}  // namespace dqslam
