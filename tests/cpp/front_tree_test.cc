#include "dqslam/linear/front_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "block_patterns.h"

namespace dqslam {
namespace {

std::vector<Pattern> Patterns() {
  Random random(1);
  std::vector<Pattern> patterns = {{{}, {}}, {{9}, {}}, {{3, 3, 9}, {}}};
  for (const int pairs : {4, 20, 100, 400}) patterns.push_back(RandomPattern(30, pairs, random));
  for (const int objects : {0, 3, 20}) {
    patterns.push_back(ChainWithObjects(100, 3, objects, objects / 3, random));
  }
  return patterns;
}

int FrontOf(const FrontTree& tree, int position) {
  const auto after = std::upper_bound(tree.first.begin(), tree.first.end(), position);
  return static_cast<int>(after - tree.first.begin()) - 1;
}

TEST(FrontTree, EliminatesEachBlockOnce) {
  for (const Pattern& pattern : Patterns()) {
    const FrontTree tree(BlockPattern(pattern.sizes, pattern.pairs));
    const std::set<int> blocks(tree.order.begin(), tree.order.end());
    EXPECT_EQ(blocks.size(), pattern.sizes.size());
    EXPECT_EQ(tree.order.size(), pattern.sizes.size());
    EXPECT_EQ(tree.first.front(), 0);
    EXPECT_EQ(tree.first.back(), static_cast<int>(pattern.sizes.size()));
    EXPECT_TRUE(std::is_sorted(tree.first.begin(), tree.first.end()));
  }
}

// What makes a factorization front by front right: every coupling is in the front of its first
// pivot, and what a front updates is in its parent, which comes later.
TEST(FrontTree, HoldsCouplingsAndUpdates) {
  for (const Pattern& pattern : Patterns()) {
    const BlockPattern A(pattern.sizes, pattern.pairs);
    const FrontTree tree(A);
    std::vector<int> position(A.num_blocks());
    for (int k = 0; k < A.num_blocks(); ++k) position[tree.order[k]] = k;
    std::vector<std::set<int>> held(tree.num_fronts());
    for (int front = 0; front < tree.num_fronts(); ++front) {
      for (int k = tree.first[front]; k < tree.first[front + 1]; ++k) held[front].insert(k);
      held[front].insert(tree.below[front].begin(), tree.below[front].end());
      EXPECT_TRUE(std::is_sorted(tree.below[front].begin(), tree.below[front].end()));
    }
    for (const auto& [i, j] : pattern.pairs) {
      const int front = FrontOf(tree, std::min(position[i], position[j]));
      EXPECT_TRUE(held[front].count(std::max(position[i], position[j])));
    }
    for (int front = 0; front < tree.num_fronts(); ++front) {
      if (tree.below[front].empty()) {
        EXPECT_EQ(tree.parent[front], -1);
        continue;
      }
      const int parent = tree.parent[front];
      EXPECT_GT(parent, front);
      EXPECT_EQ(parent, FrontOf(tree, tree.below[front].front()));
      for (const int k : tree.below[front]) EXPECT_TRUE(held[parent].count(k));
    }
  }
}

// In postorder a subtree is a run of fronts: it begins where the first of its leaves is.
TEST(FrontTree, ComesInPostorder) {
  for (const Pattern& pattern : Patterns()) {
    const FrontTree tree(BlockPattern(pattern.sizes, pattern.pairs));
    std::vector<int> begin(tree.num_fronts()), size(tree.num_fronts(), 1);
    for (int front = 0; front < tree.num_fronts(); ++front) begin[front] = front;
    for (int front = 0; front < tree.num_fronts(); ++front) {
      EXPECT_EQ(front - begin[front] + 1, size[front]);
      const int parent = tree.parent[front];
      if (parent < 0) continue;
      begin[parent] = std::min(begin[parent], begin[front]);
      size[parent] += size[front];
    }
  }
}

double FactorEntries(int poses) {
  const Pattern pattern = Drive(poses);
  const BlockPattern A(pattern.sizes, pattern.pairs);
  const FrontTree tree(A);
  double entries = 0;
  for (int front = 0; front < tree.num_fronts(); ++front) {
    double pivots = 0, below = 0;
    for (int k = tree.first[front]; k < tree.first[front + 1]; ++k) pivots += A.size(tree.order[k]);
    for (const int k : tree.below[front]) below += A.size(tree.order[k]);
    entries += pivots * (pivots + below);
  }
  return entries;
}

TEST(FrontTree, FactorGrowsLinearlyWithTheDrive) {
  const double shorter = FactorEntries(1000), longer = FactorEntries(10000);
  EXPECT_LT(longer, 10.5 * shorter);
  EXPECT_LT(shorter, 50 * 3 * 1000);  // at most 50 rows to a column of a pose
}

}  // namespace
}  // namespace dqslam
