// Turns a stage into a ceres::Problem over the rows of a state.
#pragma once

#include "dqslam/solver/stage.h"

namespace ceres {
class Problem;
}

namespace dqslam {

/// Adds poses, landmarks, odometry, boxes, positions and priors of the stage.  The problem points
/// into `state`, which must outlive it.
void Assemble(const PreparedGraph& prepared,
              const SolveOptions& options,
              const Stage& stage,
              State* state,
              ceres::Problem* problem);

}  // namespace dqslam
