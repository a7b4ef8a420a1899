#include "dqslam/solver/variables.h"

#include <algorithm>

namespace dqslam {

std::vector<int> VariableIndex::BlockSizes() const {
  std::vector<int> sizes(num_free_poses(), tangent_size);
  sizes.insert(sizes.end(), num_objects(), kLandmarkSize);
  if (moves_shared) sizes.insert(sizes.end(), num_shared, 1);
  return sizes;
}

Eigen::VectorXd VariableIndex::Pack(const State& state) const {
  Eigen::VectorXd values(num_values());
  for (int pose = first_pose; pose < end_pose; ++pose) {
    values.segment(Start(PoseRow{pose}), pose_size) = state.poses.row(pose).transpose();
  }
  for (const int object : objects) {
    values.segment<kLandmarkSize>(Start(ObjectRow{object})) = state.landmarks.row(object);
  }
  for (int row = 0; row < num_shared; ++row) {
    values[Start(SharedRow{row})] = *state.SharedAt(row);
  }
  return values;
}

void VariableIndex::Unpack(const Eigen::VectorXd& values, State* state) const {
  for (int pose = std::max(first_pose, first_free_pose); pose < end_pose; ++pose) {
    state->poses.row(pose) = values.segment(Start(PoseRow{pose}), pose_size).transpose();
  }
  for (const int object : objects) {
    state->landmarks.row(object) = values.segment<kLandmarkSize>(Start(ObjectRow{object}));
  }
  state->shared = values.tail(num_shared);
}

}  // namespace dqslam
