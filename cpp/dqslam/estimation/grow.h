// Growing: add poses a few at a time, start an object from its first track, minimize, go on.
#pragma once

#include <vector>

#include "dqslam/estimation/initialize.h"
#include "dqslam/solver/stage.h"

namespace dqslam {

/// What the starts need of some boxes of one object.
std::vector<View> ViewsOf(const PreparedGraph& prepared,
                          const State& state,
                          const std::vector<int>& boxes);

/// Landmark parameters of an object from some of its boxes, by the start of the options.
Vector9d StartObject(const PreparedGraph& prepared,
                     const SolveOptions& options,
                     const State& state,
                     int object,
                     const std::vector<int>& boxes);

/// Poses and landmarks from odometry alone; every object is started at the end.
Summary Grow(const PreparedGraph& prepared,
             const SolveOptions& options,
             const Monitor& monitor,
             State* state);

}  // namespace dqslam
