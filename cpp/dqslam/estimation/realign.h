// Realignment: new poses are moved to where their boxes show the objects that are known already, as
// at the end of a loop or behind a weak link of the odometry.
#pragma once

#include <optional>
#include <vector>

#include "dqslam/solver/stage.h"

namespace dqslam {

/// The poses from `begin` to `end`, which dead reckoning has led to in `state`, are moved together
/// by the rigid motion that takes their own view of some known objects to the places of these
/// objects in the map.  The poses between the last earlier view of these objects and `begin` take
/// up the motion as their odometry allows, and the objects seen from there move with them.
///
/// `known` are rows of objects with boxes before and after `begin`.  Returns nothing where fewer
/// than 2 of them (3 in SE(3)) agree about the motion, and for landmarks that are no ellipsoids.
std::optional<State> Realign(const SolveContext& context,
                             const std::vector<int>& known,
                             int begin,
                             int end,
                             const State& state);

}  // namespace dqslam
