#include "dqslam/linear/block_cholesky.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "block_patterns.h"

namespace dqslam {
namespace {

// Solves for a random right-hand side; the oracle is Eigen's dense LLT.
void ExpectSolvesLikeDense(const Pattern& pattern, Random& random) {
  BlockMatrix A(pattern.sizes, pattern.pairs);
  FillPositiveDefinite(pattern, random, A);
  const Eigen::VectorXd damping = RandomVector(A.rows(), random).cwiseAbs();
  const Eigen::VectorXd b = RandomVector(A.rows(), random);

  BlockCholesky cholesky(A);
  ASSERT_TRUE(cholesky.Factorize(A, damping));
  const Eigen::VectorXd x = cholesky.Solve(b);

  Eigen::MatrixXd dense = Dense(A);
  dense.diagonal() += damping;
  const Eigen::VectorXd expected = dense.llt().solve(b);
  EXPECT_LT((x - expected).norm(), 1e-10 * expected.norm());
  EXPECT_LT((dense * x - b).norm(), 1e-12 * (dense.norm() * x.norm() + b.norm()));
}

TEST(BlockCholesky, ByHand) {
  BlockMatrix A({1, 1}, {{1, 0}});
  A.Diagonal(0)[0] = 3;
  A.Diagonal(1)[0] = 1;
  A.OffDiagonal(0)[0] = 2;
  BlockCholesky cholesky(A);
  ASSERT_TRUE(cholesky.Factorize(A, Eigen::Vector2d(1, 2)));  // [4 2; 2 3], determinant 8
  const Eigen::VectorXd x = cholesky.Solve(Eigen::Vector2d(8, 16));
  EXPECT_DOUBLE_EQ(x[0], (3 * 8 - 2 * 16) / 8.0);
  EXPECT_DOUBLE_EQ(x[1], (4 * 16 - 2 * 8) / 8.0);
}

TEST(BlockCholesky, SingleBlocks) {
  Random random(2);
  for (const int size : {1, 3, 6, 9, 40}) ExpectSolvesLikeDense({{size}, {}}, random);
}

TEST(BlockCholesky, BlocksWithoutPairs) {
  Random random(3);
  ExpectSolvesLikeDense({{3, 9, 1, 6, 3}, {}}, random);
}

TEST(BlockCholesky, Empty) {
  const BlockMatrix A({}, {});
  BlockCholesky cholesky(A);
  EXPECT_TRUE(cholesky.Factorize(A, Eigen::VectorXd()));
  EXPECT_EQ(cholesky.Solve(Eigen::VectorXd()).size(), 0);
}

// From few pairs, so that most blocks stand alone, to a full matrix.
TEST(BlockCholesky, RandomPatterns) {
  Random random(4);
  for (int trial = 0; trial < 60; ++trial) {
    const int blocks = 2 + trial % 30;
    ExpectSolvesLikeDense(RandomPattern(blocks, trial * trial / 8, random), random);
  }
}

TEST(BlockCholesky, Chains) {
  Random random(5);
  for (const int poses : {2, 3, 50, 200}) {
    ExpectSolvesLikeDense(ChainWithObjects(poses, 3, 0, 0, random), random);
    ExpectSolvesLikeDense(ChainWithObjects(poses, 6, 0, 3, random), random);
  }
}

TEST(BlockCholesky, ChainsWithObjectsAndLoops) {
  Random random(6);
  for (const int objects : {1, 8, 30}) {
    ExpectSolvesLikeDense(ChainWithObjects(150, 3, objects, 4, random), random);
    ExpectSolvesLikeDense(ChainWithObjects(60, 6, objects, 2, random), random);
  }
}

// Where the matrix is nearly singular, the residual still is at rounding.
TEST(BlockCholesky, BackwardStableWhenStiff) {
  Random random(7);
  const Pattern pattern = ChainWithObjects(120, 3, 10, 2, random);
  BlockMatrix A(pattern.sizes, pattern.pairs);
  FillPositiveDefinite(pattern, random, A);
  for (int b = 0; b < A.num_blocks(); b += 7) {  // as a nearly exact prior does
    for (int r = 0; r < A.size(b); ++r) A.Diagonal(b)[r * (A.size(b) + 1)] += 1e10;
  }
  const Eigen::VectorXd damping = Eigen::VectorXd::Zero(A.rows());
  const Eigen::VectorXd b = RandomVector(A.rows(), random);
  BlockCholesky cholesky(A);
  ASSERT_TRUE(cholesky.Factorize(A, damping));
  const Eigen::VectorXd x = cholesky.Solve(b);
  EXPECT_LT((A.Multiply(x) - b).norm(), 1e-14 * Dense(A).norm() * x.norm());
}

TEST(BlockCholesky, FollowsNewValuesAndDamping) {
  Random random(8);
  const Pattern pattern = ChainWithObjects(40, 3, 5, 2, random);
  BlockMatrix A(pattern.sizes, pattern.pairs);
  BlockCholesky cholesky(A);
  const Eigen::VectorXd b = RandomVector(A.rows(), random);
  for (const double damped : {0.0, 1.0, 1e6}) {
    A.SetZero();
    FillPositiveDefinite(pattern, random, A);
    const Eigen::VectorXd damping = Eigen::VectorXd::Constant(A.rows(), damped);
    ASSERT_TRUE(cholesky.Factorize(A, damping));
    Eigen::MatrixXd dense = Dense(A);
    dense.diagonal() += damping;
    const Eigen::VectorXd expected = dense.llt().solve(b);
    EXPECT_LT((cholesky.Solve(b) - expected).norm(), 1e-10 * expected.norm()) << damped;
  }
}

TEST(BlockCholesky, SameBitsEachTime) {
  Random random(9);
  const Pattern pattern = ChainWithObjects(100, 3, 12, 3, random);
  BlockMatrix A(pattern.sizes, pattern.pairs);
  FillPositiveDefinite(pattern, random, A);
  const Eigen::VectorXd damping = Eigen::VectorXd::Constant(A.rows(), 0.1);
  const Eigen::VectorXd b = RandomVector(A.rows(), random);
  BlockCholesky first(A), second(A);
  ASSERT_TRUE(first.Factorize(A, damping));
  ASSERT_TRUE(second.Factorize(A, 2 * damping));  // leaves no trace
  ASSERT_TRUE(second.Factorize(A, damping));
  EXPECT_EQ(first.Solve(b), second.Solve(b));
}

TEST(BlockCholesky, SolvesAlikeHoweverBlocksAreNumbered) {
  Random random(10);
  const Pattern pattern = ChainWithObjects(80, 3, 9, 3, random);
  const int blocks = static_cast<int>(pattern.sizes.size());
  BlockMatrix A(pattern.sizes, pattern.pairs);
  FillPositiveDefinite(pattern, random, A);
  const Eigen::VectorXd b = RandomVector(A.rows(), random);
  BlockCholesky cholesky(A);
  ASSERT_TRUE(cholesky.Factorize(A, Eigen::VectorXd::Zero(A.rows())));
  const Eigen::VectorXd x = cholesky.Solve(b);

  std::vector<int> place(blocks);  // where the other numbering puts a block
  std::iota(place.begin(), place.end(), 0);
  for (int k = blocks - 1; k > 0; --k) {
    std::swap(place[k], place[static_cast<int>(random.Uniform(0, k + 1))]);
  }
  Pattern other{std::vector<int>(blocks), {}};
  for (int block = 0; block < blocks; ++block) other.sizes[place[block]] = pattern.sizes[block];
  for (const auto& [i, j] : pattern.pairs) other.pairs.emplace_back(place[i], place[j]);
  BlockMatrix B(other.sizes, other.pairs);
  Eigen::VectorXd moved(B.rows());
  using Block = Eigen::Map<Eigen::MatrixXd>;
  for (int k = 0; k < blocks; ++k) {
    moved.segment(B.offset(place[k]), A.size(k)) = b.segment(A.offset(k), A.size(k));
    Block(B.Diagonal(place[k]), A.size(k), A.size(k)) = Block(A.Diagonal(k), A.size(k), A.size(k));
  }
  for (size_t pair = 0; pair < pattern.pairs.size(); ++pair) {
    const int from = A.index_of_pair(pair), to = B.index_of_pair(pair);
    const auto [i, j] = A.coupled(from);
    const Block value(A.OffDiagonal(from), A.size(i), A.size(j));
    if (place[i] < place[j]) {
      Block(B.OffDiagonal(to), A.size(i), A.size(j)) = value;
    } else {
      Block(B.OffDiagonal(to), A.size(j), A.size(i)) = value.transpose();
    }
  }
  BlockCholesky renumbered(B);
  ASSERT_TRUE(renumbered.Factorize(B, Eigen::VectorXd::Zero(B.rows())));
  const Eigen::VectorXd y = renumbered.Solve(moved);
  for (int k = 0; k < blocks; ++k) {
    EXPECT_LT((y.segment(B.offset(place[k]), A.size(k)) - x.segment(A.offset(k), A.size(k))).norm(),
              1e-10 * x.norm())
        << "block " << k;
  }
}

class BlockCholeskyRefuses : public testing::Test {
 protected:
  BlockCholeskyRefuses()
      : pattern_(ChainWithObjects(30, 3, 4, 1, random_)), A_(pattern_.sizes, pattern_.pairs) {
    FillPositiveDefinite(pattern_, random_, A_);
  }
  bool Factorizes(const BlockMatrix& A) {
    return BlockCholesky(A).Factorize(A, Eigen::VectorXd::Zero(A.rows()));
  }

  Random random_{11};
  Pattern pattern_;
  BlockMatrix A_;
};

TEST_F(BlockCholeskyRefuses, AnIndefiniteMatrix) {
  ASSERT_TRUE(Factorizes(A_));
  for (int b = 0; b < A_.num_blocks(); ++b) {
    BlockMatrix A = A_;
    A.Diagonal(b)[0] = -1e-3;
    EXPECT_FALSE(Factorizes(A)) << "block " << b;
  }
}

TEST_F(BlockCholeskyRefuses, ASingularMatrix) {
  A_.SetZero();
  EXPECT_FALSE(Factorizes(A_));
}

TEST_F(BlockCholeskyRefuses, NegativeDamping) {
  BlockCholesky cholesky(A_);
  Eigen::VectorXd damping = Eigen::VectorXd::Zero(A_.rows());
  damping[7] = -1e6;
  EXPECT_FALSE(cholesky.Factorize(A_, damping));
  EXPECT_TRUE(cholesky.Factorize(A_, Eigen::VectorXd::Zero(A_.rows())));
}

TEST_F(BlockCholeskyRefuses, AnotherPatternOrTooFewDampings) {
  BlockCholesky cholesky(A_);
  const Eigen::VectorXd damping = Eigen::VectorXd::Zero(A_.rows());
  EXPECT_THROW(cholesky.Factorize(A_, damping.head(A_.rows() - 1)), std::invalid_argument);
  Pattern other = pattern_;
  other.pairs.pop_back();
  EXPECT_THROW(cholesky.Factorize(BlockMatrix(other.sizes, other.pairs), damping),
               std::invalid_argument);
}

TEST_F(BlockCholeskyRefuses, WhatIsNotFinite) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double value : {std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity}) {
    BlockMatrix diagonal = A_, below = A_, off = A_;
    diagonal.Diagonal(5)[0] = value;
    EXPECT_FALSE(Factorizes(diagonal)) << value;
    below.Diagonal(5)[2] = value;
    EXPECT_FALSE(Factorizes(below)) << value;
    for (int index = 0; index < A_.num_off_diagonal(); index += 9) {
      off.OffDiagonal(index)[0] = value;
      EXPECT_FALSE(Factorizes(off)) << value << " in block " << index;
      off = A_;
    }
  }
}

}  // namespace
}  // namespace dqslam
