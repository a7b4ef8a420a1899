// The variables of a stage in one vector: first the poses, of which the constant ones come first,
// then the objects, then the numbers that objects share.
#pragma once

#include <Eigen/Core>
#include <type_traits>
#include <vector>

#include "dqslam/problem/graph.h"

namespace dqslam {

/// A block of a term, as a row of the poses, the landmarks or the shared numbers of a state.
struct PoseRow {
  int row;
};
struct ObjectRow {
  int row;
};
struct SharedRow {
  int row;
};

/// The size of a block's tangent.
template <typename Pose, typename Row>
inline constexpr int kTangentOf = std::is_same_v<Row, PoseRow>     ? Pose::kTangentSize
                                  : std::is_same_v<Row, ObjectRow> ? kLandmarkSize
                                                                   : 1;

/// The place of each pose and object in the vector of values, in a step, and among the blocks of
/// the normal equations.
struct VariableIndex {
  int pose_size = 0, tangent_size = 0;
  int first_pose = 0, end_pose = 0;  ///< the range of poses whose values are packed
  int first_free_pose = 0;           ///< poses before it are constant and have no block
  std::vector<int> objects;          ///< rows of the objects in the stage, ascending
  std::vector<int> slot_of_object;   ///< place in `objects`, or -1 for an object not in the stage
  int num_shared = 0;                ///< all shared numbers are in each stage
  bool moves_shared = true;          ///< otherwise they are constant and have no blocks

  int num_poses() const { return end_pose - first_pose; }
  int num_free_poses() const { return end_pose > first_free_pose ? end_pose - first_free_pose : 0; }
  int num_objects() const { return static_cast<int>(objects.size()); }

  /// The first place of a block in the vector of values.
  int Start(PoseRow pose) const { return (pose.row - first_pose) * pose_size; }
  int Start(ObjectRow object) const {
    return num_poses() * pose_size + slot_of_object[object.row] * kLandmarkSize;
  }
  int Start(SharedRow shared) const {
    return num_poses() * pose_size + num_objects() * kLandmarkSize + shared.row;
  }
  int num_values() const { return Start(SharedRow{num_shared}); }

  /// The number of a block in the normal equations, below zero if it is constant.
  int Block(PoseRow pose) const {
    return pose.row < first_free_pose ? -1 : pose.row - first_free_pose;
  }
  int Block(ObjectRow object) const { return num_free_poses() + slot_of_object[object.row]; }
  int Block(SharedRow shared) const {
    return moves_shared ? num_free_poses() + num_objects() + shared.row : -1;
  }
  std::vector<int> BlockSizes() const;

  /// The first place of a block in a step, below zero if it is constant.
  int Tangent(PoseRow pose) const { return Block(pose) * tangent_size; }
  int Tangent(ObjectRow object) const {
    return num_free_poses() * tangent_size + slot_of_object[object.row] * kLandmarkSize;
  }
  int Tangent(SharedRow shared) const {
    return moves_shared ? TangentsBeforeShared() + shared.row : -1;
  }
  int num_tangents() const { return TangentsBeforeShared() + (moves_shared ? num_shared : 0); }

  Eigen::VectorXd Pack(const State& state) const;
  void Unpack(const Eigen::VectorXd& values, State* state) const;

 private:
  int TangentsBeforeShared() const {
    return num_free_poses() * tangent_size + num_objects() * kLandmarkSize;
  }
};

}  // namespace dqslam
