// Wrong associations: which boxes fit their objects, and estimation that is robust to the others.
#pragma once

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Whether a loss is robust, that is, any loss but kNone.
bool IsRobust(Loss loss);

/// Whether a loss rejects boxes by their chi-square at the state: all robust losses but Huber and
/// Cauchy.  The state must first have converged with a milder loss.
bool ThrowsBoxesOut(Loss loss);

/// Graduated non-convexity, Yang et al. 2020, with truncated least squares or Geman-McClure.  It
/// weights whole boxes; odometry is a known inlier.  It starts at the state, and ends when it is
/// clear which boxes fit.
Summary GraduateNonConvexity(const SolveContext& context, State* state);

/// Whether so few boxes do not fit at the state, none of them far from it and no object mixed, that
/// there is nothing to graduate: a fit of all boxes tells which of them fit.
bool NearlyAllFit(const SolveContext& context, const State& state);

/// The last stage of all variables, with weight 1 for the boxes that fit at the state and weight 0
/// for the others.
Stage InlierStage(const SolveContext& context, const State& state);

/// Boxes whose chi-square at the state is at most options.outlier_chi_square.
std::vector<bool> InlierBoxes(const SolveContext& context, const State& state);

}  // namespace dqslam
