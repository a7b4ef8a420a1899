// A path of odometry that is bent until its end is where it is known to be.
#pragma once

#include <vector>

#include "dqslam/geometry/batch.h"
#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// Moves the last pose of a path to a target, and spreads the motion over the steps: the most
/// likely steps under their covariances that lead there.  The first pose is constant.
/// `covariances` has one of each pose behind the first, of the step that leads to it, in its
/// tangent.
template <typename Pose>
void BendPath(
    const std::vector<Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>>& covariances,
    const Eigen::Matrix<double, Pose::kSize, 1>& target,
    RowMatrix* poses);

/// A surface that moves with a pose, from where it was beside the pose `before` to where it is
/// beside the pose `after`.
template <typename Pose>
Surface<double> MoveWith(const double* before, const double* after, const Surface<double>& surface);

}  // namespace dqslam
