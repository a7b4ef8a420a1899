#include "dqslam/linear/block_matrix.h"

#include <algorithm>

#include "dqslam/linear/parallel.h"

namespace dqslam {
namespace {

using ConstBlock = Eigen::Map<const Eigen::MatrixXd>;

}  // namespace

void BlockMatrix::SetZero(int threads) {
  constexpr std::ptrdiff_t kPart = 1 << 18;
  const auto size = static_cast<std::ptrdiff_t>(values_.size());
  ParallelForParts(threads, size, kPart, [this](std::ptrdiff_t begin, std::ptrdiff_t end) {
    std::fill(values_.begin() + begin, values_.begin() + end, 0.0);
  });
}

Eigen::VectorXd BlockMatrix::diagonal() const {
  Eigen::VectorXd diagonal(rows());
  for (int b = 0; b < num_blocks(); ++b) {
    diagonal.segment(offset(b), size(b)) = ConstBlock(Diagonal(b), size(b), size(b)).diagonal();
  }
  return diagonal;
}

Eigen::VectorXd BlockMatrix::Multiply(const Eigen::VectorXd& x) const {
  Eigen::VectorXd y = diagonal().cwiseProduct(x);
  for (int b = 0; b < num_blocks(); ++b) {
    const ConstBlock A(Diagonal(b), size(b), size(b));
    const double* x_b = x.data() + offset(b);
    double* y_b = y.data() + offset(b);
    for (int c = 0; c < size(b); ++c) {
      for (int r = c + 1; r < size(b); ++r) {
        y_b[r] += A(r, c) * x_b[c];
        y_b[c] += A(r, c) * x_b[r];
      }
    }
  }
  for (int index = 0; index < num_off_diagonal(); ++index) {
    const auto [i, j] = coupled(index);
    const ConstBlock A(OffDiagonal(index), size(i), size(j));
    y.segment(offset(i), size(i)) += A.lazyProduct(x.segment(offset(j), size(j)));
    y.segment(offset(j), size(j)) += A.transpose().lazyProduct(x.segment(offset(i), size(i)));
  }
  return y;
}

}  // namespace dqslam
