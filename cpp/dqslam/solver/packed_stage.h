// A stage whose variables stand in one vector: poses, objects, switches, as VariableIndex says.
#pragma once

#include <Eigen/Core>
#include <algorithm>

#include "dqslam/solver/stage_layout.h"

namespace ceres {
class LossFunction;
}

namespace dqslam {

template <typename Pose>
struct PackedStage {
  const PreparedGraph& prepared;
  const SolveOptions& options;
  const ceres::LossFunction* loss;  ///< of whole boxes; null: none
  VariableIndex slots;
  TermIndex links;

  int PoseStart(int pose) const { return (pose - slots.first_pose) * Pose::kSize; }
  int ObjectStart(int slot) const { return slots.num_poses() * Pose::kSize + slot * kLandmarkSize; }
  int SwitchStart() const { return ObjectStart(slots.num_objects()); }
  /// Where the tangents of variables begin in a step.
  int TangentOfPose(int pose) const { return slots.PoseBlock(pose) * Pose::kTangentSize; }
  int TangentOfObject(int slot) const {
    return slots.num_free_poses() * Pose::kTangentSize + slot * kLandmarkSize;
  }

  Eigen::VectorXd Pack(const State& state) const {
    Eigen::VectorXd values(SwitchStart() + slots.num_switches);
    for (int pose = slots.first_pose; pose < slots.end_pose; ++pose) {
      values.segment<Pose::kSize>(PoseStart(pose)) = state.poses.row(pose).transpose();
    }
    for (int slot = 0; slot < slots.num_objects(); ++slot) {
      values.segment<kLandmarkSize>(ObjectStart(slot)) =
          state.landmarks.row(slots.objects[slot]).transpose();
    }
    for (int i = 0; i < slots.num_switches; ++i) {
      values[SwitchStart() + i] = state.switches[links.boxes[i].row];
    }
    return values;
  }

  void Unpack(const Eigen::VectorXd& values, State* state) const {
    const int first = std::max(slots.first_pose, slots.first_free_pose);
    for (int pose = first; pose < slots.end_pose; ++pose) {
      state->poses.row(pose) = values.segment<Pose::kSize>(PoseStart(pose)).transpose();
    }
    for (int slot = 0; slot < slots.num_objects(); ++slot) {
      state->landmarks.row(slots.objects[slot]) =
          values.segment<kLandmarkSize>(ObjectStart(slot)).transpose();
    }
    for (int i = 0; i < slots.num_switches; ++i) {
      state->switches[links.boxes[i].row] = values[SwitchStart() + i];
    }
  }
};

}  // namespace dqslam
