// Symmetric matrix of dense blocks, most of which are absent: the normal equations of a graph.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "dqslam/linear/block_pattern.h"

namespace dqslam {

/// A symmetric matrix with the blocks of a pattern.
///
/// Blocks are column-major and contiguous, so that callers who know the sizes can accumulate
/// through Eigen::Map<Eigen::Matrix<double, 3, 9>>. Matrices can share a pattern; values
/// start at zero.
class BlockMatrix {
 public:
  explicit BlockMatrix(std::shared_ptr<const BlockPattern> pattern)
      : pattern_(std::move(pattern)), values_(pattern_->num_values(), 0.0) {}
  /// With a pattern of its own, whose constructor has these arguments.
  BlockMatrix(std::vector<int> sizes, const std::vector<std::pair<int, int>>& pairs)
      : BlockMatrix(std::make_shared<BlockPattern>(std::move(sizes), pairs)) {}

  const std::shared_ptr<const BlockPattern>& pattern() const { return pattern_; }
  int num_blocks() const { return pattern_->num_blocks(); }
  int size(int block) const { return pattern_->size(block); }
  int offset(int block) const { return pattern_->offset(block); }
  int rows() const { return pattern_->rows(); }
  int index_of_pair(size_t k) const { return pattern_->index_of_pair(k); }
  int num_off_diagonal() const { return pattern_->num_off_diagonal(); }
  int IndexOf(int i, int j) const { return pattern_->IndexOf(i, j); }
  std::pair<int, int> coupled(int index) const { return pattern_->coupled(index); }

  /// A_ii, size(i) x size(i). Only the lower triangle, its diagonal included, is ever read.
  double* Diagonal(int block) { return values_.data() + pattern_->diagonal_start(block); }
  const double* Diagonal(int block) const {
    return values_.data() + pattern_->diagonal_start(block);
  }

  /// A_ij of (i, j) = coupled(index): its rows are those of the *smaller* block number, hence
  /// size(i) x size(j) with i < j.
  double* OffDiagonal(int index) { return values_.data() + pattern_->off_diagonal_start(index); }
  const double* OffDiagonal(int index) const {
    return values_.data() + pattern_->off_diagonal_start(index);
  }

  void SetZero(int threads = 1);
  Eigen::VectorXd diagonal() const;
  /// A x.
  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const;

 private:
  std::shared_ptr<const BlockPattern> pattern_;
  std::vector<double> values_;
};

}  // namespace dqslam
