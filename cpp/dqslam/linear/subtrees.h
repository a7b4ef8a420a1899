// Parts of a tree of fronts that can be eliminated at the same time.
#pragma once

#include <vector>

namespace dqslam {

/// A front with all its descendants: the fronts from `begin` to before `end`.
struct Subtree {
  int begin, end;
};

/// Disjoint subtrees, ascending, with most of the cost of a large tree; none for a small tree.
/// Fronts are in postorder, `parent` has -1 for a root, and costs are in multiplications.
std::vector<Subtree> SplitTree(const std::vector<int>& parent, const std::vector<double>& cost);

}  // namespace dqslam
