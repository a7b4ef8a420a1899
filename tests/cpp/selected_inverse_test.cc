#include "dqslam/linear/selected_inverse.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "random.h"

namespace dqslam {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// A chain of blocks, each tied to its neighbor, and one block tied to all: an arrowhead.
Sparse ChainWithLandmark(const std::vector<int>& sizes, Random& random) {
  int rows = 0;
  for (const int size : sizes) rows += size;
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(rows, rows);
  int offset = 0;
  for (size_t b = 0; b + 1 < sizes.size(); ++b) {
    const int next = b + 2 < sizes.size() ? sizes[b + 1] : 0;
    const int last = sizes.back();
    for (const int tied : {next, last}) {
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(12, rows);
      J.middleCols(offset, sizes[b]).setRandom();
      J.middleCols(tied == last && tied != next ? rows - last : offset + sizes[b], tied)
          .setRandom();
      J *= random.Uniform(0.5, 2);
      dense += J.transpose() * J;
    }
    offset += sizes[b];
  }
  return dense.sparseView();
}

TEST(SelectedInverseTest, AgreesWithTheDenseInverse) {
  Random random(1);
  const std::vector<int> sizes = {3, 3, 3, 3, 3, 3, 9};
  const Sparse H = ChainWithLandmark(sizes, random);
  const Eigen::MatrixXd inverse = Eigen::MatrixXd(H).inverse();
  const SelectedInverse selected(H);
  int offset = 0;
  for (size_t b = 0; b < sizes.size(); ++b) {
    const Eigen::MatrixXd expected = inverse.block(offset, offset, sizes[b], sizes[b]);
    EXPECT_LT((selected.Block(offset, sizes[b]) - expected).norm(), 1e-9 * expected.norm())
        << "block " << b;
    offset += sizes[b];
  }
}

TEST(SelectedInverseTest, ByHand) {
  Sparse H(2, 2);
  H.insert(0, 0) = 4;
  H.insert(0, 1) = 2;
  H.insert(1, 0) = 2;
  H.insert(1, 1) = 3;  // inverse: [3 -2; -2 4] / 8
  const SelectedInverse selected(H);
  EXPECT_DOUBLE_EQ(selected(0, 0), 3.0 / 8);
  EXPECT_DOUBLE_EQ(selected(0, 1), -2.0 / 8);
  EXPECT_DOUBLE_EQ(selected(1, 1), 4.0 / 8);
}

TEST(SelectedInverseTest, RefusesAnIndefiniteMatrix) {
  Sparse H(2, 2);
  H.insert(0, 0) = 1;
  H.insert(1, 1) = -1;
  EXPECT_THROW(SelectedInverse{H}, std::runtime_error);
}

}  // namespace
}  // namespace dqslam
