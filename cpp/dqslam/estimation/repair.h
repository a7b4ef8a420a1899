// Objects that are stuck in an impossible place, found by their boxes and started again.
#pragma once

#include "dqslam/solver/stage.h"

namespace dqslam {

/// The last stage: all poses and all boxes, with the last residual of the options.
Stage BatchStage(const PreparedGraph& prepared, const SolveOptions& options);

/// Objects whose boxes are impossible by the noise model, most of them or in the mean.
std::vector<bool> StuckObjects(const PreparedGraph& prepared,
                               const SolveOptions& options,
                               const State& state);

/// Whether odometry fits so badly that a part of the path must lie the wrong way round: boxes fit
/// there as well, of a place that is turned by a whole turn more than odometry says.
bool IsTorn(const PreparedGraph& prepared, const State& state);

/// Objects of few boxes have several minima, in depth above all: starts each of them, and those
/// whose size the prior excludes, at the depth of the prior size as well, by itself.  What lowers
/// its own cost there is tried on the whole, and kept if it lowers that too.
void TryOtherDepths(const PreparedGraph& prepared,
                    const SolveOptions& options,
                    const Monitor& monitor,
                    State* state,
                    Summary* summary);

/// Leaves out the objects whose typical box is impossible by the noise model, minimizes the rest,
/// starts those objects again from all their views, and minimizes all; as long as that lowers the
/// cost.  `summary` is that of the last stage so far and is updated.
void RestartStuckObjects(const PreparedGraph& prepared,
                         const SolveOptions& options,
                         const Monitor& monitor,
                         State* state,
                         Summary* summary);

}  // namespace dqslam
