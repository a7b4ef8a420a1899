// Growing: add a few poses, start the objects that have enough boxes, minimize, and repeat.
#pragma once

#include <vector>

#include "dqslam/estimation/initialize.h"
#include "dqslam/solver/stage.h"

namespace dqslam {

/// The views from which an object is started: some of its boxes with their cameras.
std::vector<View> ViewsOf(const PreparedGraph& prepared,
                          const State& state,
                          const std::vector<int>& boxes);

/// Landmark parameters of an object from some of its boxes, by the method options.start.
Vector9d StartObject(const SolveContext& context,
                     const State& state,
                     int object,
                     const std::vector<int>& boxes);

/// Estimates poses and landmarks from the odometry on.  At the end every object has been started.
Summary Grow(const SolveContext& context, State* state);

}  // namespace dqslam
