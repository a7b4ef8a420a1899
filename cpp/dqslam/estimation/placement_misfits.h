// How far an estimate is from each placement of a graph.
#pragma once

#include "dqslam/problem/graph.h"
#include "dqslam/problem/options.h"

namespace dqslam {

/// The norm of the residual of each placement, in sigmas and before its switch.  Throws
/// std::invalid_argument for a state that does not fit the graph.
Eigen::VectorXd PlacementMisfits(const Graph& graph,
                                 const SolveOptions& options,
                                 const State& state);

}  // namespace dqslam
