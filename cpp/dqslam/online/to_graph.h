// A history as a problem for Solve().
#pragma once

#include "dqslam/online/linearize.h"

namespace dqslam::online {

/// Objects without a box take no part: `rows` has the row in the history of each that does.
template <typename Pose>
Graph ToGraph(const Model& model, const History<Pose>& history, std::vector<int>* rows);

}  // namespace dqslam::online
