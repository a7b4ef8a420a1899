// Normal equations of a least-squares problem, and how residuals are added to them.
#pragma once

#include <Eigen/Core>

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
  explicit Accumulator(NormalEquations* equations) : equations_(*equations), H_(equations_.H) {}

  /// Adds J^T J and J^T r of one block. lazyProduct avoids the copy of a 4 x 9 operand that
  /// Eigen's usual product makes.
  template <int kRows, int kColumns>
  void AddDiagonal(int block,
                   const Eigen::Matrix<double, kRows, kColumns>& J,
                   const Eigen::Matrix<double, kRows, 1>& residual) {
    if (block < 0) return;
    equations_.gradient.segment<kColumns>(H_.offset(block)).noalias() += J.transpose() * residual;
    Eigen::Map<Eigen::Matrix<double, kColumns, kColumns>>(H_.Diagonal(block)).noalias() +=
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

 private:
  NormalEquations& equations_;
  BlockMatrix& H_;
};

}  // namespace dqslam
