// Normal equations of a least-squares problem, and how residuals are added to them.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <unordered_map>
#include <vector>

#include "dqslam/linear/block_matrix.h"

namespace dqslam {

/// The Gauss-Newton step solves H step = -gradient.
struct NormalEquations {
  double cost = 0;           ///< half the sum of the squared residuals, after the loss
  Eigen::VectorXd gradient;  ///< J^T r
  BlockMatrix H;             ///< J^T J
};

/// Adds residuals with their derivatives, block by block.  A block below zero is constant and is
/// skipped.
class Accumulator {
 public:
  explicit Accumulator(NormalEquations* equations)
      : Accumulator(equations, 0, equations->H.num_blocks()) {}
  /// Of the blocks on the diagonal, it writes only to those from `begin` to before `end`, so that
  /// others can add to the rest in the meantime.  What it adds to the rest waits for AddWaiting().
  Accumulator(NormalEquations* equations, int begin, int end)
      : equations_(*equations), H_(equations_.H), begin_(begin), end_(end) {}

  /// Adds J^T J and J^T r of one block. lazyProduct avoids the copy of a 4 x 9 operand that
  /// Eigen's usual product makes.
  template <int kRows, int kColumns>
  void AddDiagonal(int block,
                   const Eigen::Matrix<double, kRows, kColumns>& J,
                   const Eigen::Matrix<double, kRows, 1>& residual) {
    if (block < 0) return;
    double* gradient = equations_.gradient.data() + H_.offset(block);
    double* diagonal = H_.Diagonal(block);
    if (block < begin_ || block >= end_) {
      gradient = Waiting(block);
      diagonal = gradient + kColumns;
    }
    Eigen::Map<Eigen::Matrix<double, kColumns, 1>>(gradient).noalias() += J.transpose() * residual;
    Eigen::Map<Eigen::Matrix<double, kColumns, kColumns>>(diagonal).noalias() +=
        J.transpose().lazyProduct(J);
  }

  /// Adds J_a^T J_b of two blocks; J_a belongs to the block with the smaller number.
  template <int kRows, int kA, int kB>
  void AddOffDiagonal(int shared,
                      const Eigen::Matrix<double, kRows, kA>& J_a,
                      const Eigen::Matrix<double, kRows, kB>& J_b) {
    if (shared < 0) return;
    Eigen::Map<Eigen::Matrix<double, kA, kB>>(H_.OffDiagonal(shared)).noalias() +=
        J_a.transpose() * J_b;
  }

  /// Adds what waits, in the order in which the blocks came first.  Nothing waits any more.
  void AddWaiting() {
    for (const int block : waiting_blocks_) {
      const int size = H_.size(block);
      const double* gradient = &waiting_[start_of_[block]];
      for (int i = 0; i < size; ++i) equations_.gradient[H_.offset(block) + i] += gradient[i];
      const double* diagonal = gradient + size;
      for (int i = 0; i < size * size; ++i) H_.Diagonal(block)[i] += diagonal[i];
    }
    waiting_blocks_.clear();
    start_of_.clear();
    waiting_.clear();
  }

 private:
  double* Waiting(int block) {
    const auto [entry, is_new] = start_of_.try_emplace(block, waiting_.size());
    if (is_new) {
      waiting_blocks_.push_back(block);
      const size_t size = H_.size(block);
      waiting_.resize(waiting_.size() + size * (size + 1));
    }
    return &waiting_[entry->second];
  }

  NormalEquations& equations_;
  BlockMatrix& H_;
  int begin_, end_;
  std::vector<int> waiting_blocks_;
  std::unordered_map<int, size_t> start_of_;  // of a block in waiting_
  std::vector<double> waiting_;               // the gradient of each block, then its diagonal
};

}  // namespace dqslam
