// Measured distance from the robot to an object's center, for example from a radio tag:
//   r = W (|c - t| - range)
//
// Blocks: world_from_robot [d], landmark [9].  Residual: [1], in sigmas.
// Returns false within 1 mm of the center, because the distance has no derivative at the center.
#pragma once

#include <cmath>

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

inline constexpr double kMinRange = 1e-3;  ///< meters

template <typename Pose, typename Landmark>
struct RangeCost : AutoDiffCost<RangeCost<Pose, Landmark>, 1, Pose::kSize, kLandmarkSize> {
  static constexpr const char* kName = "range";
  Eigen::Matrix<double, 1, 1> value;             ///< range, meters
  Eigen::Matrix<double, 1, 1> sqrt_information;  ///< 1 / meters

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    using std::sqrt;
    const Vector3<T> robot = Pose::WorldFromRobot(pose).translation;
    const T squared = (Landmark::Unpack(landmark).center - robot).squaredNorm();
    if (!(squared > T(kMinRange * kMinRange))) return false;
    const Eigen::Matrix<T, 1, 1> error(sqrt(squared) - value[0]);
    Whiten(sqrt_information, error, residual);
    return true;
  }
};

}  // namespace dqslam
