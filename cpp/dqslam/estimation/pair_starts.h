// Starts of an object some of whose boxes show something else.
#pragma once

#include <vector>

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Spheres through two boxes of an object at a time, the ones that most of its boxes are near to,
/// best first and not at the same place.  All pairs are tried, or evenly chosen ones where there
/// are many.  Only for ellipsoids.
std::vector<Vector9d> StartsFromPairs(const SolveContext& context, const State& state, int object);

}  // namespace dqslam
