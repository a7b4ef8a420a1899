// Objects that are stuck in an impossible place, found by their boxes and started again.
#pragma once

#include "dqslam/optimize.h"

namespace dqslam {

/// The last stage: all poses and all boxes, with the last residual of the options.
Stage BatchStage(const PreparedGraph& prepared, const SolveOptions& options);

/// Objects whose typical box is impossible by the noise model.
std::vector<bool> StuckObjects(const PreparedGraph& prepared,
                               const SolveOptions& options,
                               const State& state);

/// Objects of few boxes have several minima, in depth above all: starts each of them at the depth
/// of the prior size as well, minimises all, and keeps what lowers the cost.
void TryOtherDepths(const PreparedGraph& prepared,
                    const SolveOptions& options,
                    const Monitor& monitor,
                    State* state,
                    Summary* summary);

/// Leaves out the objects whose typical box is impossible by the noise model, minimises the rest,
/// starts those objects again from all their views, and minimises all; as long as that lowers the
/// cost.  `summary` is that of the last stage so far and is updated.
void RestartStuckObjects(const PreparedGraph& prepared,
                         const SolveOptions& options,
                         const Monitor& monitor,
                         State* state,
                         Summary* summary);

}  // namespace dqslam
