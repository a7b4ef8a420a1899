// Wrong associations: which boxes belong to their objects, and estimation that is not led astray.
#pragma once

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Whether a loss doubts boxes at all.
bool IsRobust(Loss loss);

/// Whether a loss throws boxes out by their chi-square at the state, which must have settled first.
bool ThrowsBoxesOut(Loss loss);

/// Graduated non-convexity, Yang et al. 2020, truncated least squares or Geman-McClure, on whole
/// boxes; odometry is a known inlier.  Starts at the state; weights are 0 or 1 at the end.
Summary GraduateNonConvexity(const PreparedGraph& prepared,
                             const SolveOptions& options,
                             const Monitor& monitor,
                             State* state);

/// Boxes whose chi-square at the state is at most options.outlier_chi_square.
std::vector<bool> InlierBoxes(const PreparedGraph& prepared,
                              const SolveOptions& options,
                              const State& state);

}  // namespace dqslam
