// A saved state, to which a failed attempt returns.
#pragma once

#include <algorithm>
#include <vector>

#include "dqslam/online/history.h"

namespace dqslam::online {

/// The poses from `begin` on and all objects, at the time of construction.
template <typename Pose>
class Checkpoint {
 public:
  Checkpoint(const History<Pose>& history, int begin)
      : begin_(begin), poses_(history.poses.begin() + begin, history.poses.end()) {
    center_shapes_.reserve(history.objects.size());
    for (const Object& object : history.objects) center_shapes_.push_back(object.center_shape);
  }

  void Restore(History<Pose>* history) const {
    std::copy(poses_.begin(), poses_.end(), history->poses.begin() + begin_);
    for (size_t row = 0; row < center_shapes_.size(); ++row)
      history->objects[row].center_shape = center_shapes_[row];
  }

 private:
  int begin_;
  std::vector<typename History<Pose>::Storage> poses_;
  std::vector<Vector9d> center_shapes_;
};

}  // namespace dqslam::online
