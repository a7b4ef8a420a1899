// Repair of a solution: objects that are stuck in a wrong minimum are found and started again.
#pragma once

#include <cstddef>

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Whether so many of an object's boxes do not fit that they may be of several objects.
bool IsMixed(std::ptrdiff_t misfits, std::ptrdiff_t boxes);

/// The last stage: it has all poses, all boxes and the last residual of the options.
Stage BatchStage(const SolveContext& context);

/// The part of a stage that is one object by itself: some of its boxes with weight 1, in the order
/// of their poses, which are constant.
Stage StageOfObject(const Stage& all, const std::vector<int>& boxes, const Graph& graph);

/// Objects whose boxes in a stage are impossible under the noise model: the median of their
/// chi-square exceeds 13.28, which is the 99 % quantile, or the mean exceeds twice that.
std::vector<bool> StuckObjects(const SolveContext& context, const Stage& stage, const State& state);

/// The squared Mahalanobis distance of each odometry row from the poses.
Eigen::VectorXd OdometryChiSquares(const PreparedGraph& prepared, const State& state);

/// Whether odometry fits so badly, with a chi-square above 5 per degree of freedom, that a part of
/// the path must have the wrong orientation.  Boxes can fit well there, because a heading that is
/// wrong by a whole turn shows the same images.
bool IsTorn(const PreparedGraph& prepared, const State& state);

/// A stage that has not converged, for instance since an object has collapsed on the way, is
/// minimized again from where it is, first with the Cauchy loss if it has another one, and the
/// result is kept if the cost is lower.
void Recover(const SolveContext& context, const Stage& all, State* state, Summary* summary);

/// Objects with at most 3 boxes have several minima, mainly in depth; so have those whose size the
/// prior excludes, and, if `from_parts`, those with many boxes that do not fit.  Minimizes each of
/// these by itself from the depth of the prior size, and the last ones from some of their boxes at
/// a time as well. In SE(2), tilts all objects the other way, too, unless there is a loss.  Objects
/// that reach a lower cost there are moved, the whole stage `all` is minimized, and the result is
/// kept if the total cost is lower.  `summary` ends with that stage and is updated.
void TryOtherStarts(
    const SolveContext& context, const Stage& all, bool from_parts, State* state, Summary* summary);

/// Leaves out the stuck objects, minimizes the rest of the stage `all`, starts the stuck objects
/// again from all their views, and minimizes everything.  Repeats this, at most twice, as long as
/// it lowers the cost.  `summary` ends with that stage and is updated.
void RestartStuckObjects(const SolveContext& context,
                         const Stage& all,
                         State* state,
                         Summary* summary);

}  // namespace dqslam
