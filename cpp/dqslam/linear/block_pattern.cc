#include "dqslam/linear/block_pattern.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>

namespace dqslam {
namespace {

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

BlockPattern::BlockPattern(std::vector<int> sizes, const std::vector<std::pair<int, int>>& pairs)
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
  first_coupled_.assign(num_blocks() + 1, 0);
  for (const auto& [i, j] : coupled_) ++first_coupled_[i + 1];
  std::partial_sum(first_coupled_.begin(), first_coupled_.end(), first_coupled_.begin());

  for (const int size : sizes_) {
    diagonal_start_.push_back(num_values_);
    num_values_ += std::ptrdiff_t{size} * size;
  }
  for (const auto& [i, j] : coupled_) {
    off_diagonal_start_.push_back(num_values_);
    num_values_ += std::ptrdiff_t{sizes_[i]} * sizes_[j];
  }
}

int BlockPattern::IndexOf(int i, int j) const {
  if (i > j) std::swap(i, j);
  const auto begin = coupled_.begin() + first_coupled_[i];
  const auto end = coupled_.begin() + first_coupled_[i + 1];
  const auto found = std::lower_bound(begin, end, std::make_pair(i, j));
  if (found == end || found->second != j) return -1;
  return static_cast<int>(found - coupled_.begin());
}

}  // namespace dqslam
