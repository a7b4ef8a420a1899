// Symmetric matrix of dense blocks, most of which are absent: the normal equations of a graph.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <utility>
#include <vector>

namespace dqslam {

/// A symmetric matrix. It stores all blocks on the diagonal and, once each, the requested blocks
/// off the diagonal.
///
/// Blocks are column-major and contiguous, so that callers who know the sizes can accumulate
/// through Eigen::Map<Eigen::Matrix<double, 3, 9>>. The pattern never changes; values start at
/// zero.
class BlockMatrix {
 public:
  /// `sizes` are the rows of each block on the diagonal, at least 1. `pairs` are the blocks (i, j),
  /// i != j, that are coupled; they may be in either order and may be repeated.
  /// Throws std::invalid_argument that names the block or the pair.
  BlockMatrix(std::vector<int> sizes, const std::vector<std::pair<int, int>>& pairs);

  int num_blocks() const { return static_cast<int>(sizes_.size()); }
  int size(int block) const { return sizes_[block]; }
  /// First row of a block; offset(num_blocks()) is the number of rows of A.
  int offset(int block) const { return offsets_[block]; }
  int rows() const { return offsets_.back(); }

  /// Index of the block off the diagonal that belongs to the k-th entry of `pairs`.
  int index_of_pair(size_t k) const { return index_of_pair_[k]; }
  int num_off_diagonal() const { return static_cast<int>(coupled_.size()); }
  /// The blocks (i, j), i < j, that a block off the diagonal couples.
  std::pair<int, int> coupled(int index) const { return coupled_[index]; }

  /// A_ii, size(i) x size(i). Only the lower triangle, its diagonal included, is ever read.
  double* Diagonal(int block) { return values_.data() + diagonal_start_[block]; }
  const double* Diagonal(int block) const { return values_.data() + diagonal_start_[block]; }

  /// A_ij of (i, j) = coupled(index): its rows are those of the *smaller* block number, hence
  /// size(i) x size(j) with i < j.
  double* OffDiagonal(int index) { return values_.data() + off_diagonal_start_[index]; }
  const double* OffDiagonal(int index) const { return values_.data() + off_diagonal_start_[index]; }

  void SetZero(int threads = 1);
  Eigen::VectorXd diagonal() const;
  /// A x.
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const;

 private:
  std::vector<int> sizes_, offsets_;
  std::vector<std::pair<int, int>> coupled_;  // ascending
  std::vector<int> index_of_pair_;
  std::vector<std::ptrdiff_t> diagonal_start_, off_diagonal_start_;  // in values_
  std::vector<double> values_;
};

}  // namespace dqslam
