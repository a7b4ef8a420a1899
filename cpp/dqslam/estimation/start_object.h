// The start of an object in a graph, by the method of the options.
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

}  // namespace dqslam
