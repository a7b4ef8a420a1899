// Where a minimization begins again, and what it goes back to if that was in vain.
#pragma once

#include <algorithm>
#include <vector>

#include "dqslam/online/history.h"

namespace dqslam::online {

/// Poses from `begin` on, and all objects, as they were.
template <typename Pose>
class Checkpoint {
 public:
  Checkpoint(const History<Pose>& history, int begin)
      : begin_(begin), poses_(history.poses.begin() + begin, history.poses.end()) {
    for (const Object& object : history.objects) charts_.push_back(object.center_shape);
  }

  void Restore(History<Pose>* history) const {
    std::copy(poses_.begin(), poses_.end(), history->poses.begin() + begin_);
    for (size_t row = 0; row < charts_.size(); ++row)
      history->objects[row].center_shape = charts_[row];
  }

 private:
  int begin_;
  std::vector<typename History<Pose>::Storage> poses_;
  std::vector<Vector9d> charts_;
};

/// Poses from `begin` on as their odometry has them, from the one before.
template <typename Pose>
void BackToOdometry(int begin, History<Pose>* history) {
  for (int pose = std::max(begin, 1); pose < history->num_poses(); ++pose) {
    Pose::Compose(history->poses[pose - 1].data(),
                  history->steps[pose].relative.data(),
                  history->poses[pose].data());
    Pose::Normalize(history->poses[pose].data());
  }
}

}  // namespace dqslam::online
