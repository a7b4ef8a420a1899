#include "dqslam/linear/block_matrix.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "block_patterns.h"

namespace dqslam {
namespace {

using testing::HasSubstr;

// Blocks 0 and 2 of one row, 1 of three: A = [2 a^T 5; a B 0; 5 0 7] with a = (1, 2, 3).
BlockMatrix ByHand() {
  BlockMatrix A({1, 3, 1}, {{1, 0}, {0, 2}, {0, 1}});
  A.Diagonal(0)[0] = 2;
  Eigen::Map<Eigen::Matrix3d> B(A.Diagonal(1));
  B << 4, 100, 100, /**/ 1, 5, 100, /**/ 0, 2, 6;  // 100: above the diagonal, never read
  A.Diagonal(2)[0] = 7;
  Eigen::Map<Eigen::RowVector3d>(A.OffDiagonal(A.index_of_pair(0))) << 1, 2, 3;
  A.OffDiagonal(A.index_of_pair(1))[0] = 5;
  return A;
}

TEST(BlockMatrix, MultipliesByHand) {
  Eigen::VectorXd x(5), expected(5);
  x << 1, 1, 0, 2, -1;
  // 2 + (1 + 6) - 5;  1 + (4 + 0);  2 + (1 + 4);  3 + 12;  5 - 7
  expected << 4, 5, 7, 15, -2;
  EXPECT_EQ(ByHand().Multiply(x), expected);
}

TEST(BlockMatrix, GivesTheDiagonal) {
  Eigen::VectorXd expected(5);
  expected << 2, 4, 5, 6, 7;
  EXPECT_EQ(ByHand().diagonal(), expected);
}

TEST(BlockMatrix, BothOrdersOfAPairAreOneBlock) {
  const BlockMatrix A = ByHand();
  EXPECT_EQ(A.num_off_diagonal(), 2);
  EXPECT_EQ(A.index_of_pair(0), A.index_of_pair(2));
  EXPECT_NE(A.index_of_pair(0), A.index_of_pair(1));
  EXPECT_EQ(A.coupled(A.index_of_pair(0)), std::make_pair(0, 1));
  EXPECT_EQ(A.coupled(A.index_of_pair(1)), std::make_pair(0, 2));
}

TEST(BlockMatrix, LaysOutItsRows) {
  const BlockMatrix A = ByHand();
  EXPECT_EQ(A.num_blocks(), 3);
  EXPECT_EQ(A.size(1), 3);
  EXPECT_EQ(A.offset(1), 1);
  EXPECT_EQ(A.offset(2), 4);
  EXPECT_EQ(A.rows(), 5);
}

TEST(BlockMatrix, MultipliesLikeTheDenseMatrix) {
  Random random(1);
  const Pattern pattern = ChainWithObjects(20, 3, 4, 2, random);
  BlockMatrix A(pattern.sizes, pattern.pairs);
  FillPositiveDefinite(pattern, random, A);
  const Eigen::VectorXd x = RandomVector(A.rows(), random);
  const Eigen::MatrixXd dense = Dense(A);
  EXPECT_LT((A.Multiply(x) - dense * x).norm(), 1e-13 * (dense * x).norm());
  EXPECT_EQ(A.diagonal(), dense.diagonal());
}

TEST(BlockMatrix, StartsAtZeroAndReturnsToIt) {
  BlockMatrix A = ByHand();
  A.SetZero();
  EXPECT_EQ(Dense(A), Eigen::MatrixXd::Zero(5, 5));
  EXPECT_EQ(Dense(BlockMatrix({3, 9}, {{0, 1}})), Eigen::MatrixXd::Zero(12, 12));
}

TEST(BlockMatrix, MayBeEmpty) {
  const BlockMatrix A({}, {});
  EXPECT_EQ(A.rows(), 0);
  EXPECT_EQ(A.Multiply(Eigen::VectorXd()).size(), 0);
}

std::string Message(std::vector<int> sizes, const Pairs& pairs) {
  try {
    BlockMatrix(std::move(sizes), pairs);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "no exception";
}

TEST(BlockMatrix, NamesTheImpossibleBlockOrPair) {
  EXPECT_THAT(Message({3, 0}, {}), HasSubstr("sizes[1] must be at least 1, got 0"));
  EXPECT_THAT(Message({3, 3}, {{0, 1}, {1, 1}}), HasSubstr("pairs[1] = (1, 1)"));
  EXPECT_THAT(Message({3, 3}, {{0, 2}}), HasSubstr("pairs[0] = (0, 2)"));
  EXPECT_THAT(Message({3, 3}, {{-1, 0}}), HasSubstr("pairs[0] = (-1, 0)"));
}

}  // namespace
}  // namespace dqslam
