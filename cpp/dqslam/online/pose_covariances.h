// The covariance of the present pose, kept up from step to step.
//
// A window gives the covariance of its last pose as if all poses before it were exact.  Their error
// is added: what lies before the window, path and map, moves as a whole with the pose before it,
// whose covariance is known.  A smoothing that reaches the first pose therefore gives the exact
// covariance, and the steps after it add to that.
#pragma once

#include <optional>
#include <vector>

#include "dqslam/online/history.h"

namespace dqslam::online {

template <typename Pose>
class PoseCovariances {
 public:
  using Square = typename History<Pose>::Square;

  /// The covariance of the last pose in its tangent.
  const Square& last() const { return of_pose_.back(); }

  /// Sets the covariance of all poses from `begin` on to what odometry alone gives.
  void DeadReckon(const History<Pose>& history, int begin);

  /// Sets the covariance of the last pose to that of a window, which begins at the pose `begin` and
  /// has `conditional` as the covariance with all poses before it constant.
  void TakeWindow(const History<Pose>& history, int begin, const Square& conditional);

  /// The same for a smoothing, after which the poses before the last one are known better, too.
  void TakeSmoothing(const History<Pose>& history, int begin, const Square& conditional);

 private:
  /// The covariance of a pose that moves rigidly with another one.
  Square Moved(const History<Pose>& history, int from, int to) const;

  std::vector<Square> of_pose_;  ///< as known when the pose was the last, or smoothed later
};

}  // namespace dqslam::online
