#include "dqslam/linear/layout_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "block_patterns.h"
#include "dqslam/linear/block_cholesky.h"

namespace dqslam {
namespace {

TEST(BlockPattern, FindsBlocksInEitherOrder) {
  const BlockPattern pattern({1, 3, 1, 2}, {{1, 0}, {0, 3}, {2, 1}});
  for (int k = 0; k < 3; ++k) {
    const auto [i, j] = pattern.coupled(k);
    EXPECT_EQ(pattern.IndexOf(i, j), k);
    EXPECT_EQ(pattern.IndexOf(j, i), k);
  }
  EXPECT_EQ(pattern.IndexOf(0, 2), -1);
  EXPECT_EQ(pattern.IndexOf(3, 2), -1);
  EXPECT_EQ(pattern.IndexOf(1, 1), -1);
}

TEST(LayoutCache, KeepsWhatServes) {
  Random random(1);
  const Pattern pattern = ChainWithObjects(90, 3, 2, 3, random);
  LayoutCache cache;
  const auto first = cache.PatternOf(pattern.sizes, pattern.pairs);
  EXPECT_EQ(cache.PatternOf(pattern.sizes, pattern.pairs), first);
  EXPECT_EQ(cache.EliminationOf(first), cache.EliminationOf(first));
  auto less = pattern.pairs;
  less.pop_back();
  EXPECT_EQ(cache.PatternOf(pattern.sizes, less), first);
}

TEST(LayoutCache, LaysOutWhatIsNew) {
  Random random(2);
  const Pattern pattern = ChainWithObjects(90, 3, 2, 3, random);
  LayoutCache cache;
  const auto first = cache.PatternOf(pattern.sizes, pattern.pairs);
  const auto elimination = cache.EliminationOf(first);

  auto sizes = pattern.sizes;
  ++sizes.back();
  EXPECT_NE(cache.PatternOf(sizes, pattern.pairs), first);

  const auto again = cache.PatternOf(pattern.sizes, pattern.pairs);
  EXPECT_NE(cache.EliminationOf(again), elimination);

  auto few = pattern.pairs;
  few.resize(few.size() / 2);
  const auto smaller = cache.PatternOf(pattern.sizes, few);
  EXPECT_LT(smaller->num_off_diagonal(), again->num_off_diagonal());
  EXPECT_EQ(cache.PatternOf(pattern.sizes, few), smaller);

  EXPECT_THROW(cache.PatternOf({1, 1}, {{0, 2}}), std::invalid_argument);
}

// What is not coupled is zero in the pattern of the cache, and the solution is the same.
TEST(LayoutCache, SolvesWithinALargerPattern) {
  Random random(3);
  Pattern pattern = ChainWithObjects(60, 3, 4, 3, random);
  LayoutCache cache;
  const auto larger = cache.PatternOf(pattern.sizes, pattern.pairs);
  const auto elimination = cache.EliminationOf(larger);
  pattern.pairs.pop_back();
  BlockMatrix A(pattern.sizes, pattern.pairs),
      within(cache.PatternOf(pattern.sizes, pattern.pairs));
  FillPositiveDefinite(pattern, random, A);
  ASSERT_EQ(within.pattern(), larger);
  for (int block = 0; block < A.num_blocks(); ++block) {
    std::copy_n(A.Diagonal(block), A.size(block) * A.size(block), within.Diagonal(block));
  }
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    std::copy_n(
        A.OffDiagonal(index), A.size(i) * A.size(j), within.OffDiagonal(within.IndexOf(i, j)));
  }
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(A.rows()), b = Eigen::VectorXd::Ones(A.rows());
  BlockCholesky own(A), shared(elimination);
  ASSERT_TRUE(own.Factorize(A, none));
  ASSERT_TRUE(shared.Factorize(within, none));
  const Eigen::VectorXd expected = own.Solve(b);
  EXPECT_LT((shared.Solve(b) - expected).norm(), 1e-10 * expected.norm());
}

}  // namespace
}  // namespace dqslam
