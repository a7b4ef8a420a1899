#include "dqslam/linear/subtrees.h"

#include <cstddef>
#include <numeric>

namespace dqslam {
namespace {

// A tree of less cost, about a millisecond, is not split.
constexpr double kLeastTotal = 3e6;
// The largest and the least subtree, as shares of the cost.  Where objects are all along a path,
// about a quarter of the cost is in subtrees of less than 1 / 1024, which hang on the trunk.
constexpr double kLargest = 1.0 / 16, kLeast = 1.0 / 16384;

}  // namespace

std::vector<Subtree> SplitTree(const std::vector<int>& parent, const std::vector<double>& cost) {
  const double total = std::accumulate(cost.begin(), cost.end(), 0.0);
  std::vector<Subtree> subtrees;
  if (total < kLeastTotal) return subtrees;
  std::vector<double> below = cost;  // of each front with its descendants
  std::vector<int> begin(parent.size(), -1);
  for (size_t f = 0; f < parent.size(); ++f) {
    if (begin[f] < 0) begin[f] = static_cast<int>(f);
    if (parent[f] < 0) continue;
    below[parent[f]] += below[f];
    if (begin[parent[f]] < 0) begin[parent[f]] = begin[f];
  }
  for (size_t f = 0; f < parent.size(); ++f) {
    const bool fits = below[f] <= kLargest * total && below[f] >= kLeast * total;
    const bool is_largest = parent[f] < 0 || below[parent[f]] > kLargest * total;
    if (fits && is_largest) subtrees.push_back({begin[f], static_cast<int>(f) + 1});
  }
  return subtrees;
}

}  // namespace dqslam
