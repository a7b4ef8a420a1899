#include "dqslam/block_matrix.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace dqslam {
namespace {

using ConstBlock = Eigen::Map<const Eigen::MatrixXd>;

std::vector<int> Offsets(const std::vector<int>& sizes) {
  std::vector<int> offsets(sizes.size() + 1, 0);
  for (size_t b = 0; b < sizes.size(); ++b) {
    if (sizes[b] < 1) {
      throw std::invalid_argument("sizes[" + std::to_string(b) + "] must be at least 1, got " +
                                  std::to_string(sizes[b]));
    }
    offsets[b + 1] = offsets[b] + sizes[b];
  }
  return offsets;
}

// (i, j) with i < j.
std::pair<int, int> Ascending(const std::pair<int, int>& pair, size_t k, int blocks) {
  const auto [i, j] = pair;
  if (i == j || i < 0 || j < 0 || i >= blocks || j >= blocks) {
    throw std::invalid_argument("pairs[" + std::to_string(k) + "] = (" + std::to_string(i) + ", " +
                                std::to_string(j) + ") must be two different blocks of " +
                                std::to_string(blocks));
  }
  return {std::min(i, j), std::max(i, j)};
}

}  // namespace

BlockMatrix::BlockMatrix(std::vector<int> sizes, const std::vector<std::pair<int, int>>& pairs)
    : sizes_(std::move(sizes)), offsets_(Offsets(sizes_)) {
  coupled_.reserve(pairs.size());
  for (size_t k = 0; k < pairs.size(); ++k) {
    coupled_.push_back(Ascending(pairs[k], k, num_blocks()));
  }
  const std::vector<std::pair<int, int>> asked = coupled_;
  std::sort(coupled_.begin(), coupled_.end());
  coupled_.erase(std::unique(coupled_.begin(), coupled_.end()), coupled_.end());
  coupled_.shrink_to_fit();
  index_of_pair_.reserve(asked.size());
  for (const std::pair<int, int>& pair : asked) {
    const auto found = std::lower_bound(coupled_.begin(), coupled_.end(), pair);
    index_of_pair_.push_back(static_cast<int>(found - coupled_.begin()));
  }

  std::ptrdiff_t start = 0;
  for (const int size : sizes_) {
    diagonal_start_.push_back(start);
    start += std::ptrdiff_t{size} * size;
  }
  for (const auto& [i, j] : coupled_) {
    off_diagonal_start_.push_back(start);
    start += std::ptrdiff_t{sizes_[i]} * sizes_[j];
  }
  values_.assign(start, 0.0);
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
