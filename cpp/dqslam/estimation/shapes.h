// The shapes of objects: which are cuboids or cylinders, and where.
#pragma once

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Gives the objects the shapes of the graph, and those with Shape::kAuto the shape that explains
/// their boxes best.  `state` is the solution with ellipsoids.  Each object is fitted by itself
/// from several rotations, then all objects and poses together; both are repeated while an object
/// finds a lower cost.  `summary` ends with the stage `all` and is updated.
void FitShapes(const SolveContext& context, const Stage& all, State* state, Summary* summary);

}  // namespace dqslam
