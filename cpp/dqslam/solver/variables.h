// The variables of a stage in one vector: poses, then objects; those that are constant lead.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dqslam/problem/graph.h"

namespace dqslam {

/// Where each pose and object stands in the vector of values, in a step, and among the blocks of
/// the normal equations.
struct VariableIndex {
  int pose_size = 0, tangent_size = 0;
  int first_pose = 0, end_pose = 0;  ///< whose values are packed
  int first_free_pose = 0;           ///< poses before it are constant, and have no block
  std::vector<int> objects;          ///< rows, ascending
  std::vector<int> slot_of_object;   ///< place in `objects`; -1: takes no part

  int num_poses() const { return end_pose - first_pose; }
  int num_free_poses() const { return end_pose > first_free_pose ? end_pose - first_free_pose : 0; }
  int num_objects() const { return static_cast<int>(objects.size()); }

  /// Places in the vector of values.
  int PoseStart(int pose) const { return (pose - first_pose) * pose_size; }
  int ObjectStart(int slot) const { return num_poses() * pose_size + slot * kLandmarkSize; }
  int num_values() const { return ObjectStart(num_objects()); }

  /// Blocks of the normal equations; below zero: constant.
  int PoseBlock(int pose) const { return pose < first_free_pose ? -1 : pose - first_free_pose; }
  int ObjectBlock(int object) const { return num_free_poses() + slot_of_object[object]; }
  std::vector<int> BlockSizes() const;

  /// Places in a step.
  int TangentOfPose(int pose) const { return PoseBlock(pose) * tangent_size; }
  int TangentOfObject(int slot) const {
    return num_free_poses() * tangent_size + slot * kLandmarkSize;
  }

  Eigen::VectorXd Pack(const State& state) const;
  void Unpack(const Eigen::VectorXd& values, State* state) const;
};

}  // namespace dqslam
