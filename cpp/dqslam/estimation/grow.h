// Growing: add a part of the path, start the objects that have enough boxes, minimize, and repeat.
#pragma once

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Estimates poses and landmarks from the odometry on, part by part.  A part ends where odometry no
/// longer predicts the directions of objects, see options.grow_angle.  Where its boxes contradict
/// the map, it is realigned.  At the end every object has been started.
Summary Grow(const SolveContext& context, State* state);

}  // namespace dqslam
