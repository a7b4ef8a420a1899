#include "dqslam/linear/dense_front.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <vector>

#include "random.h"

namespace dqslam {
namespace {

using Eigen::MatrixXd;

// A positive definite front, split as EliminatePivots takes it.
struct Split {
  Split(const MatrixXd& matrix, int pivots)
      : rows(static_cast<int>(matrix.rows())),
        columns(pivots),
        update(rows - pivots, rows - pivots) {
    factor.assign(rows * columns + kFrontPadding, std::numeric_limits<double>::quiet_NaN());
    Eigen::Map<MatrixXd>(factor.data(), rows, columns) = matrix.leftCols(columns);
    update = matrix.bottomRightCorner(rows - columns, rows - columns);
  }
  bool Eliminate() { return EliminatePivots(columns, rows, factor.data(), update.data()); }
  MatrixXd L() const { return Eigen::Map<const MatrixXd>(factor.data(), rows, columns); }

  int rows, columns;
  std::vector<double> factor;
  MatrixXd update;
};

MatrixXd PositiveDefinite(int rows, Random& random) {
  const MatrixXd root = MatrixXd::NullaryExpr(rows, rows, [&] { return random.Normal(); });
  return root * root.transpose() + MatrixXd::Identity(rows, rows);
}

// The oracle is Eigen's dense LLT of the whole front, and the Schur complement by its inverse.
TEST(EliminatePivots, AgreesWithDenseAlgebra) {
  Random random(1);
  for (const int rows : {1, 2, 3, 4, 5, 9, 12, 15, 31, 64, 70}) {
    for (const int pivots : {1, 2, 3, 4, 5, 6, 8, 9, 15, 30, 64, 70}) {
      if (pivots > rows) continue;
      const MatrixXd A = PositiveDefinite(rows, random);
      Split split(A, pivots);
      ASSERT_TRUE(split.Eliminate());
      const MatrixXd L = A.llt().matrixL();
      const MatrixXd below = A.bottomLeftCorner(rows - pivots, pivots);
      const MatrixXd schur = A.bottomRightCorner(rows - pivots, rows - pivots) -
                             below * A.topLeftCorner(pivots, pivots).inverse() * below.transpose();
      const MatrixXd factor_error = split.L() - L.leftCols(pivots);
      const MatrixXd update_error = split.update - schur;
      EXPECT_LT(MatrixXd(factor_error.triangularView<Eigen::Lower>()).norm(), 1e-12 * L.norm())
          << rows << " rows, " << pivots << " pivots";
      EXPECT_LT(MatrixXd(update_error.triangularView<Eigen::Lower>()).norm(), 1e-10 * A.norm())
          << rows << " rows, " << pivots << " pivots";
    }
  }
}

TEST(EliminatePivots, ByHand) {
  MatrixXd A(2, 2);
  A << 4, 2, 2, 5;
  Split split(A, 1);
  ASSERT_TRUE(split.Eliminate());
  EXPECT_EQ(split.L()(0, 0), 2);
  EXPECT_EQ(split.L()(1, 0), 1);
  EXPECT_EQ(split.update(0, 0), 5 - 1);
}

TEST(EliminatePivots, ReadsTheLowerTriangleOnly) {
  Random random(2);
  const MatrixXd A = PositiveDefinite(14, random);
  MatrixXd half = A;
  half.triangularView<Eigen::StrictlyUpper>().setConstant(1e300);
  Split whole(A, 6), lower(half, 6);
  ASSERT_TRUE(whole.Eliminate());
  ASSERT_TRUE(lower.Eliminate());
  for (int c = 0; c < 6; ++c) {
    EXPECT_EQ(whole.L().col(c).tail(14 - c), lower.L().col(c).tail(14 - c));
  }
  for (int c = 0; c < 8; ++c) {
    EXPECT_EQ(whole.update.col(c).tail(8 - c), lower.update.col(c).tail(8 - c));
  }
}

TEST(EliminatePivots, RefusesEachPivotThatIsNotPositiveAndFinite) {
  Random random(3);
  const MatrixXd A = PositiveDefinite(11, random);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double value : {-1e-9, kInfinity, -kInfinity, std::nan("")}) {
    for (int pivot = 0; pivot < 7; ++pivot) {
      MatrixXd bad = A;
      bad(pivot, pivot) = value;
      EXPECT_FALSE(Split(bad, 7).Eliminate()) << "pivot " << pivot << " is " << value;
      EXPECT_TRUE(pivot == 0 || Split(bad, pivot).Eliminate()) << "before pivot " << pivot;
    }
  }
}

}  // namespace
}  // namespace dqslam
