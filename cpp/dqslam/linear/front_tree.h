// The order in which the blocks of a matrix are eliminated, and which blocks are eliminated
// together.
#pragma once

#include <vector>

#include "dqslam/linear/block_pattern.h"

namespace dqslam {

/// A front is a run of blocks in the order of elimination. It updates only the pivots and the rows
/// of its parent.
struct FrontTree {
  explicit FrontTree(const BlockPattern& A);

  int num_fronts() const { return static_cast<int>(parent.size()); }

  std::vector<int> order;   ///< block of A at each position
  std::vector<int> first;   ///< position of each front's first pivot, then the number of blocks
  std::vector<int> parent;  ///< a later front, or -1 for a root
  std::vector<std::vector<int>> below;  ///< positions of the rows below each front's pivots
};

}  // namespace dqslam
