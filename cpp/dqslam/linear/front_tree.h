// In which order the blocks of a matrix are eliminated, and which of them together.
#pragma once

#include <vector>

#include "dqslam/linear/block_matrix.h"

namespace dqslam {

/// Fronts are runs of blocks in the order of elimination. A front updates the pivots and the rows
/// of its parent alone.
struct FrontTree {
  explicit FrontTree(const BlockMatrix& A);

  int num_fronts() const { return static_cast<int>(parent.size()); }

  std::vector<int> order;   ///< block of A at each position
  std::vector<int> first;   ///< position of each front's first pivot; the last one ends them all
  std::vector<int> parent;  ///< a later front; -1: none
  std::vector<std::vector<int>> below;  ///< positions of the rows below each front's pivots
};

}  // namespace dqslam
