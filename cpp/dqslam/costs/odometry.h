// Odometry:  r = W ((x_i o u_i) (-) x_{i+1}).   [S&M17] eq. (7), left term
//
// Blocks: from [d], to [d], both world_from_robot.  Residual: [k], in sigmas.  Never fails.
// u_i is a relative pose, to_in_from.  The paper's motion model f(x, (v, omega)) in SE(2) drives v
// forward and then turns by omega, which is the relative pose (v, 0, omega).
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

template <typename Pose>
struct OdometryCost
    : AutoDiffCost<OdometryCost<Pose>, Pose::kTangentSize, Pose::kSize, Pose::kSize> {
  Eigen::Matrix<double, Pose::kSize, 1> to_in_from;
  Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize> sqrt_information;

  template <typename T>
  bool operator()(const T* from, const T* to, T* residual) const {
    const Eigen::Matrix<T, Pose::kSize, 1> relative = to_in_from.template cast<T>();
    Eigen::Matrix<T, Pose::kSize, 1> predicted;
    Eigen::Matrix<T, Pose::kTangentSize, 1> error;
    Pose::Compose(from, relative.data(), predicted.data());
    Minus<Pose>(predicted.data(), to, error.data());
    Whiten(sqrt_information, error, residual);
    return true;
  }
};

}  // namespace dqslam
