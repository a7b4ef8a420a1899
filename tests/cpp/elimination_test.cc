#include "dqslam/linear/elimination.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>
#include <tuple>

#include "block_patterns.h"

namespace dqslam {
namespace {

class EliminationTest : public testing::TestWithParam<int> {
 protected:
  EliminationTest() : A_(pattern_.sizes, pattern_.pairs), elimination_(A_) {}

  // The rows of a front, in the order of elimination.
  std::vector<int> RowsOf(int f) const {
    const Front& front = elimination_.fronts[f];
    std::vector<int> rows;
    for (int k = 0; k < front.pivots; ++k) rows.push_back(front.pivot + k);
    for (int k = 0; k < front.below; ++k) rows.push_back(elimination_.rows[front.row + k]);
    return rows;
  }

  Random random_{static_cast<unsigned>(GetParam())};
  Pattern pattern_ = GetParam() % 2 ? RandomPattern(40, 10 * GetParam(), random_)
                                    : ChainWithObjects(90, 3, 2 * GetParam(), 3, random_);
  BlockPattern A_;
  Elimination elimination_;
};

INSTANTIATE_TEST_SUITE_P(Patterns, EliminationTest, testing::Range(1, 9));

TEST_P(EliminationTest, PlacesRowsOnce) {
  std::vector<int> place = elimination_.place;
  std::sort(place.begin(), place.end());
  ASSERT_EQ(static_cast<int>(place.size()), A_.rows());
  for (int r = 0; r < A_.rows(); ++r) EXPECT_EQ(place[r], r);
}

TEST_P(EliminationTest, PlacesEachBlockWhereItsRowsAre) {
  std::set<int> placed;
  for (int f = 0; f < elimination_.num_fronts(); ++f) {
    const std::vector<int> rows = RowsOf(f);
    EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
    for (int k = elimination_.fronts[f].block; k < elimination_.fronts[f + 1].block; ++k) {
      const PlacedBlock& block = elimination_.blocks[k];
      int i = -1 - block.index, j = i;
      if (block.index >= 0) std::tie(i, j) = A_.coupled(block.index);
      if (block.transposed) std::swap(i, j);
      EXPECT_EQ(rows[block.row], elimination_.place[A_.offset(i)]);
      EXPECT_EQ(rows[block.column], elimination_.place[A_.offset(j)]);
      EXPECT_GE(block.row, block.column);
      EXPECT_LT(block.column, elimination_.fronts[f].pivots);
      EXPECT_TRUE(placed.insert(block.index).second);
    }
  }
  EXPECT_EQ(static_cast<int>(placed.size()), A_.num_blocks() + A_.num_off_diagonal());
}

TEST_P(EliminationTest, RunsMeetTheSameRows) {
  for (int f = 0; f < elimination_.num_fronts(); ++f) {
    const std::vector<int> rows = RowsOf(f);
    for (int k = elimination_.fronts[f].child; k < elimination_.fronts[f + 1].child; ++k) {
      const int child = elimination_.children[k].front;
      int covered = 0;
      for (int r = elimination_.children[k].run; r < elimination_.children[k + 1].run; ++r) {
        const RowRun& run = elimination_.runs[r];
        EXPECT_EQ(run.from, covered);
        for (int step = 0; step < run.length; ++step) {
          EXPECT_EQ(rows[run.to + step],
                    elimination_.rows[elimination_.fronts[child].row + run.from + step]);
        }
        covered += run.length;
      }
      EXPECT_EQ(covered, elimination_.fronts[child].below);
    }
  }
}

// No update is written where another one still waits.
TEST_P(EliminationTest, UpdatesDoNotMeetOnTheirStacks) {
  std::set<int> waiting;
  const auto End = [&](const Front& front) {
    return front.update + std::ptrdiff_t{front.below} * front.below;
  };
  for (int f = 0; f < elimination_.num_fronts(); ++f) {
    const Front& front = elimination_.fronts[f];
    EXPECT_LE(End(front), elimination_.stack_size[front.stack]);
    for (const int other : waiting) {
      const Front& waits = elimination_.fronts[other];
      EXPECT_TRUE(waits.stack != front.stack || End(waits) <= front.update ||
                  End(front) <= waits.update);
    }
    for (int k = front.child; k < elimination_.fronts[f + 1].child; ++k) {
      EXPECT_EQ(waiting.erase(elimination_.children[k].front), 1u);
    }
    if (front.below > 0) waiting.insert(f);
  }
  EXPECT_TRUE(waiting.empty());
}

TEST(Elimination, UpdatesThatWaitDoNotGrowWithTheDrive) {
  const auto Stacks = [](int poses) {
    const Pattern pattern = Drive(poses);
    const Elimination elimination(BlockPattern(pattern.sizes, pattern.pairs));
    return std::accumulate(
        elimination.stack_size.begin(), elimination.stack_size.end(), std::ptrdiff_t{0});
  };
  EXPECT_LT(Stacks(40000), 1.5 * Stacks(10000));
}

// The fronts of a subtree add the updates of no other front, and only its last one hands an update
// on.
TEST(Elimination, SubtreesAreApart) {
  const Pattern pattern = MeetingDrives(40, 500);
  const Elimination elimination(BlockPattern(pattern.sizes, pattern.pairs));
  ASSERT_GE(elimination.subtrees.size(), 30u);
  for (size_t s = 0; s < elimination.subtrees.size(); ++s) {
    const auto [begin, end] = elimination.subtrees[s];
    for (int f = begin; f < end; ++f) {
      const Front& front = elimination.fronts[f];
      EXPECT_EQ(front.stack / 2, static_cast<int>(s) + 1);
      for (int k = front.child; k < elimination.fronts[f + 1].child; ++k) {
        EXPECT_GE(elimination.children[k].front, begin);
      }
    }
    const Front& last = elimination.fronts[end - 1];
    EXPECT_EQ(last.update, 0);
    EXPECT_GE(elimination.fronts[end].factor, last.factor + last.rows() * last.pivots + 3);
  }
}

}  // namespace
}  // namespace dqslam
