// Measured position of an object's center:  r = W (z_ij - T_i(q^t_j)).   [S&M17] eq. (8)
//
// Blocks: world_from_robot [d], landmark [9].  Residual: [3], in sigmas.  Never fails.
// T_i takes the center from the world into the robot frame.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

template <typename Pose, typename Landmark>
struct RelativePositionCost
    : AutoDiffCost<RelativePositionCost<Pose, Landmark>, 3, Pose::kSize, kLandmarkSize> {
  static constexpr const char* kName = "position";
  Eigen::Vector3d value;             ///< object_in_robot, meters
  Eigen::Matrix3d sqrt_information;  ///< 1 / meters

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    const Rigid<T> world_from_robot = Pose::WorldFromRobot(pose);
    const Vector3<T> center = Landmark::Unpack(landmark).center;
    const Vector3<T> predicted =
        world_from_robot.rotation.transpose() * (center - world_from_robot.translation);
    Whiten<3, T>(sqrt_information, value.cast<T>() - predicted, residual);
    return true;
  }
};

}  // namespace dqslam
