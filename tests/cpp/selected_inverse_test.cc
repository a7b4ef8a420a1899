#include "dqslam/linear/selected_inverse.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <stdexcept>

#include "block_patterns.h"

namespace dqslam {
namespace {

struct Factorized {
  explicit Factorized(const Pattern& pattern, Random& random)
      : A(pattern.sizes, pattern.pairs), cholesky(A) {
    FillPositiveDefinite(pattern, random, A);
    const Eigen::VectorXd damping = RandomVector(A.rows(), random).cwiseAbs();
    EXPECT_TRUE(cholesky.Factorize(A, damping));
    Eigen::MatrixXd dense = Dense(A);
    dense.diagonal() += damping;
    inverse = dense.inverse();
  }
  Eigen::MatrixXd Expected(int i, int j) const {
    return inverse.block(A.offset(i), A.offset(j), A.size(i), A.size(j));
  }

  BlockMatrix A;
  BlockCholesky cholesky;
  Eigen::MatrixXd inverse;
};

void ExpectInverseLikeDense(const Pattern& pattern, Random& random) {
  const Factorized given(pattern, random);
  const SelectedInverse selected(given.A, given.cholesky);
  const double tolerance = 1e-10 * given.inverse.norm();
  for (int b = 0; b < given.A.num_blocks(); ++b) {
    EXPECT_LT((selected.Block(b, b) - given.Expected(b, b)).norm(), tolerance) << "block " << b;
  }
  for (const auto& [i, j] : pattern.pairs) {
    EXPECT_LT((selected.Block(i, j) - given.Expected(i, j)).norm(), tolerance) << i << ' ' << j;
  }
  // Any rows at all, also those that the factor does not couple.
  std::vector<int> rows;
  for (int row = random.Uniform(0, 3); row < given.A.rows(); row += random.Uniform(1, 9)) {
    rows.insert(rows.begin(), row);
  }
  const Eigen::MatrixXd expected = given.inverse(rows, rows);
  EXPECT_LT((InverseAt(given.cholesky, rows) - expected).norm(), tolerance);
}

TEST(SelectedInverse, ByHand) {
  BlockMatrix A({1, 1}, {{0, 1}});
  A.Diagonal(0)[0] = 4;
  A.Diagonal(1)[0] = 3;
  A.OffDiagonal(0)[0] = 2;  // inverse: [3 -2; -2 4] / 8
  BlockCholesky cholesky(A);
  ASSERT_TRUE(cholesky.Factorize(A, Eigen::Vector2d::Zero()));
  const SelectedInverse selected(A, cholesky);
  EXPECT_DOUBLE_EQ(selected.Block(0, 0)(0, 0), 3.0 / 8);
  EXPECT_DOUBLE_EQ(selected.Block(0, 1)(0, 0), -2.0 / 8);
  EXPECT_DOUBLE_EQ(selected.Block(1, 1)(0, 0), 4.0 / 8);
  const Eigen::MatrixXd turned = InverseAt(cholesky, {1, 0});
  EXPECT_DOUBLE_EQ(turned(0, 0), 4.0 / 8);
  EXPECT_DOUBLE_EQ(turned(0, 1), -2.0 / 8);
}

TEST(SelectedInverse, RandomPatterns) {
  Random random(1);
  for (int trial = 0; trial < 40; ++trial) {
    ExpectInverseLikeDense(RandomPattern(2 + trial % 30, trial * trial / 8, random), random);
  }
}

TEST(SelectedInverse, ChainsWithObjectsAndLoops) {
  Random random(2);
  for (const int poses : {2, 12, 60}) {
    ExpectInverseLikeDense(ChainWithObjects(poses, 3, 0, 0, random), random);
    ExpectInverseLikeDense(ChainWithObjects(poses, 6, 7, 2, random), random);
  }
}

TEST(SelectedInverse, NamesBlocksThatAreNotCoupled) {
  Random random(3);
  const Factorized given({{3, 9}, {}}, random);
  const SelectedInverse selected(given.A, given.cholesky);
  EXPECT_THROW(selected.Block(0, 1), std::invalid_argument);
  // They are independent, and where nothing couples them that is known all the same.
  EXPECT_EQ(InverseAt(given.cholesky, {0, 5})(0, 1), 0);
  EXPECT_EQ(InverseAt(given.cholesky, {}).size(), 0);
}

}  // namespace
}  // namespace dqslam
