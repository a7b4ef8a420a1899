#include "dqslam/online/pose_covariances.h"

#include <Eigen/LU>
#include <algorithm>

namespace dqslam::online {

template <typename Pose>
typename PoseCovariances<Pose>::Square PoseCovariances<Pose>::Moved(const History<Pose>& history,
                                                                    int from,
                                                                    int to) const {
  typename History<Pose>::Storage from_in_to;
  Pose::Between(history.poses[to].data(), history.poses[from].data(), from_in_to.data());
  const Square turn = Adjoint<Pose>(from_in_to.data());
  return turn * of_pose_[from] * turn.transpose();
}

template <typename Pose>
void PoseCovariances<Pose>::DeadReckon(const History<Pose>& history, int begin) {
  of_pose_.resize(history.num_poses(), Square::Zero());
  for (int pose = begin; pose < history.num_poses(); ++pose) {
    if (pose > 0) {
      of_pose_[pose] = Moved(history, pose - 1, pose) + history.steps[pose].covariance;
    } else if (!history.first_pose_is_known) {
      of_pose_[pose] = history.steps[pose].covariance;
    }
  }
}

template <typename Pose>
void PoseCovariances<Pose>::TakeWindow(const History<Pose>& history,
                                       int begin,
                                       const Square& conditional) {
  const int last = history.num_poses() - 1;
  of_pose_[last] = conditional;
  if (begin > 0) of_pose_[last] += Moved(history, begin - 1, last);
}

template <typename Pose>
void PoseCovariances<Pose>::TakeSmoothing(const History<Pose>& history,
                                          int begin,
                                          const Square& conditional) {
  TakeWindow(history, begin, conditional);
  // Steps and smoothings that follow begin behind one of these poses.
  const int last = history.num_poses() - 1;
  for (int pose = std::max(begin, 1); pose < last; ++pose) {
    const Square moved = Moved(history, last, pose);
    if (moved.determinant() < of_pose_[pose].determinant()) of_pose_[pose] = moved;
  }
}

template class PoseCovariances<Se2>;
template class PoseCovariances<Se3>;

}  // namespace dqslam::online
