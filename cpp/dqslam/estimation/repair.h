// Repair of a solution: objects that are stuck in a wrong minimum are found and started again.
#pragma once

#include "dqslam/solver/stage.h"

namespace dqslam {

/// The last stage: it has all poses, all boxes and the last residual of the options.
Stage BatchStage(const SolveContext& context);

/// Objects whose boxes are impossible under the noise model: the median of their chi-square exceeds
/// 13.28, which is the 99 % quantile, or the mean exceeds twice that.
std::vector<bool> StuckObjects(const SolveContext& context, const State& state);

/// Whether odometry fits so badly, with a chi-square above 5 per degree of freedom, that a part of
/// the path must have the wrong orientation.  Boxes can fit well there, because a heading that is
/// wrong by a whole turn shows the same images.
bool IsTorn(const PreparedGraph& prepared, const State& state);

/// Objects with at most 3 boxes have several minima, mainly in depth.  Minimizes each of these, and
/// each object whose size the prior excludes, by itself from the depth of the prior size.  Objects
/// that reach a lower cost there are moved, all poses and objects are minimized, and the result is
/// kept if the total cost is lower.
void TryOtherDepths(const SolveContext& context, State* state, Summary* summary);

/// Leaves out the stuck objects, minimizes the rest, starts the stuck objects again from all their
/// views, and minimizes everything.  Repeats this, at most twice, as long as it lowers the cost.
/// `summary` is that of all stages so far and is updated.
void RestartStuckObjects(const SolveContext& context, State* state, Summary* summary);

}  // namespace dqslam
