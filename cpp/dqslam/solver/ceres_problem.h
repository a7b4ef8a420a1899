// A stage as a ceres::Problem over the rows of a state.
#pragma once

#include "dqslam/solver/stage.h"

namespace ceres {
class Problem;
}

namespace dqslam {

/// Adds all terms of the stage, with their poses and objects, to the problem.  The problem points
/// into `state`, which must outlive it.
void MakeCeresProblem(const SolveContext& context,
                      const Stage& stage,
                      State* state,
                      ceres::Problem* problem);

}  // namespace dqslam
