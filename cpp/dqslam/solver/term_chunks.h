// The terms of a large stage in parts that can be linearized at the same time.
#pragma once

#include <vector>

#include "dqslam/solver/stage_terms.h"

namespace dqslam {

/// The boxes of successive poses, and the odometry whose later pose is one of these.  No other
/// chunk has a term between the same two blocks.
struct TermChunk {
  int first_pose, end_pose;
  TermRange odometry, boxes;
};

/// Splits odometry and boxes into chunks, which depend on the terms alone.  If there is more than
/// one chunk, the terms are first sorted by pose.
std::vector<TermChunk> SplitTerms(const Graph& graph, StageTerms* terms);

}  // namespace dqslam
