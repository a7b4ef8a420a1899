// Which blocks of a symmetric matrix are there.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace dqslam {

/// All blocks on the diagonal and, once each, the requested blocks off the diagonal.
class BlockPattern {
 public:
  /// `sizes` are the rows of each block on the diagonal, at least 1. `pairs` are the blocks (i, j),
  /// i != j, that are coupled; they may be in either order and may be repeated.
  /// Throws std::invalid_argument that names the block or the pair.
  BlockPattern(std::vector<int> sizes, const std::vector<std::pair<int, int>>& pairs);

  const std::vector<int>& sizes() const { return sizes_; }
  int num_blocks() const { return static_cast<int>(sizes_.size()); }
  int size(int block) const { return sizes_[block]; }
  /// First row of a block; offset(num_blocks()) is the number of rows of the matrix.
  int offset(int block) const { return offsets_[block]; }
  int rows() const { return offsets_.back(); }

  /// Index of the block off the diagonal that belongs to the k-th entry of `pairs`.
  int index_of_pair(size_t k) const { return index_of_pair_[k]; }
  int num_off_diagonal() const { return static_cast<int>(coupled_.size()); }
  /// Index of the block off the diagonal that couples two blocks, in either order, or -1.
  int IndexOf(int i, int j) const;
  /// The blocks (i, j), i < j, that a block off the diagonal couples.
  std::pair<int, int> coupled(int index) const { return coupled_[index]; }

  /// Where a block begins among the values, of which there are num_values().
  std::ptrdiff_t diagonal_start(int block) const { return diagonal_start_[block]; }
  std::ptrdiff_t off_diagonal_start(int index) const { return off_diagonal_start_[index]; }
  std::ptrdiff_t num_values() const { return num_values_; }

 private:
  std::vector<int> sizes_, offsets_;
  std::vector<std::pair<int, int>> coupled_;  // ascending
  std::vector<int> first_coupled_;            // of each block as the smaller one, then the end
  std::vector<int> index_of_pair_;
  std::vector<std::ptrdiff_t> diagonal_start_, off_diagonal_start_;
  std::ptrdiff_t num_values_ = 0;
};

}  // namespace dqslam
