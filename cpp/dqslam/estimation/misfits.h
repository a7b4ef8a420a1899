// What boxes that are left out say of a solution: a pose or an object may be in a wrong minimum.
#pragma once

#include <vector>

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Successive poses.
struct PoseRun {
  int first;
  int last;
};

/// The cost with half the threshold for each box that does not fit: what graduated non-convexity
/// with truncated least squares minimizes.  `cost` is that of the boxes that fit.
double TruncatedCost(const SolveContext& context, const State& state, double cost);

/// Runs of poses none of whose boxes fit, although there are some, and whose odometry does not fit
/// either: from the pose before the run to the pose behind it, its chi-square exceeds the 99.9 %
/// quantile by more than that of the other steps does.  Wrong boxes alone leave the odometry as it
/// is, and a slip of the odometry leaves boxes that fit.
std::vector<PoseRun> MisplacedPoses(const SolveContext& context, const State& state);

/// Starts misplaced poses again between their neighbors, and objects with many boxes that do not
/// fit from some of their boxes at a time.  The result is kept if the truncated cost is lower.
/// `last` is the stage of the boxes that fit; it and `summary`, which ends with it, are updated.
void RestartMisfits(const SolveContext& context, Stage* last, State* state, Summary* summary);

}  // namespace dqslam
