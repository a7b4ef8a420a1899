#include "dqslam/linear/block_matrix.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>

#include "dqslam/linear/parallel.h"

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

// The pair in ascending order.
std::pair<int, int> Ascending(const std::pair<int, int>& pair, size_t k, int blocks) {
  const auto [i, j] = pair;
  if (i == j || i < 0 || j < 0 || i >= blocks || j >= blocks) {
    throw std::invalid_argument("pairs[" + std::to_string(k) + "] = (" + std::to_string(i) + ", " +
                                std::to_string(j) + ") must be two different blocks of " +
                                std::to_string(blocks));
  }
  return {std::min(i, j), std::max(i, j)};
}

// Sorts items by key(item), which is in [0, keys).  It counts keys, because a large graph has
// millions of pairs.
template <typename Key>
std::vector<int> StableSort(const std::vector<int>& items, int keys, const Key& key) {
  std::vector<int> next(keys + 1, 0), sorted(items.size());
  for (const int item : items) ++next[key(item) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (const int item : items) sorted[next[key(item)]++] = item;
  return sorted;
}

}  // namespace

BlockMatrix::BlockMatrix(std::vector<int> sizes, const std::vector<std::pair<int, int>>& pairs)
    : sizes_(std::move(sizes)), offsets_(Offsets(sizes_)) {
  std::vector<std::pair<int, int>> asked;
  asked.reserve(pairs.size());
  for (size_t k = 0; k < pairs.size(); ++k) {
    asked.push_back(Ascending(pairs[k], k, num_blocks()));
  }
  std::vector<int> order(pairs.size());
  std::iota(order.begin(), order.end(), 0);
  order = StableSort(order, num_blocks(), [&](int k) { return asked[k].second; });
  order = StableSort(order, num_blocks(), [&](int k) { return asked[k].first; });
  index_of_pair_.resize(pairs.size());
  for (const int k : order) {
    if (coupled_.empty() || coupled_.back() != asked[k]) coupled_.push_back(asked[k]);
    index_of_pair_[k] = num_off_diagonal() - 1;
  }
  coupled_.shrink_to_fit();

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
