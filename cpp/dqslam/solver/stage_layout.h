// What takes part in a stage, and where it stands in the values and in the normal equations.
#pragma once

#include <utility>
#include <vector>

#include "dqslam/linear/block_matrix.h"
#include "dqslam/solver/stage.h"

namespace dqslam {

/// What a box asks for in a stage; fixed while the stage runs.
struct BoxRole {
  Residual residual = Residual::kBox;  ///< not kTangentThenBox
  double depth = 0;                    ///< at which tangents turn into pixels, meters
  EdgeFlags one_sided = EdgeFlags::Constant(false);

  bool IsAlgebraic() const {
    return residual == Residual::kAlgebraic || residual == Residual::kAlgebraicNormalized;
  }
};

/// Where the box residual is undefined at the state, the box gets the tangent residual.
BoxRole RoleOfBox(const PreparedGraph& prepared,
                  const SolveOptions& options,
                  const Stage& stage,
                  const State& state,
                  int box);

/// Values are packed in the order of poses, objects, switches; the blocks of variables likewise,
/// without the poses that are constant.
struct VariableIndex {
  int first_pose = 0, end_pose = 0;  ///< whose values are packed
  int first_free_pose = 0;
  std::vector<int> objects;         ///< rows, ascending
  std::vector<int> slot_of_object;  ///< place in `objects`; -1: takes no part
  int num_switches = 0;             ///< one a box of the stage, or none

  int num_poses() const { return end_pose - first_pose; }
  int num_free_poses() const { return end_pose > first_free_pose ? end_pose - first_free_pose : 0; }
  int num_objects() const { return static_cast<int>(objects.size()); }
  /// Blocks of variables; -1: constant.
  int PoseBlock(int pose) const { return pose < first_free_pose ? -1 : pose - first_free_pose; }
  int ObjectBlock(int object) const { return num_free_poses() + slot_of_object[object]; }
  int SwitchBlock(int i) const { return num_free_poses() + num_objects() + i; }
};

/// A term of two blocks: its row in a table of the graph, and the block of H off the diagonal that
/// it fills; -1 where one of the two is constant.
struct Link {
  int row, shared;
};

struct BoxLink : Link {
  BoxRole role;
  double weight;  ///< of the loss
};

struct TermIndex {
  std::vector<Link> odometry, positions;
  std::vector<BoxLink> boxes;
  /// Blocks that the switch of each box shares with its pose and its object.
  std::vector<std::pair<int, int>> switches;
};

struct StageLayout {
  VariableIndex slots;
  TermIndex links;
  BlockMatrix H;
};

StageLayout MakeStageLayout(const PreparedGraph& prepared,
                            const SolveOptions& options,
                            const Stage& stage,
                            const State& state);

}  // namespace dqslam
