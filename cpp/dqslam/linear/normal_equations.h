// Normal equations of a least-squares problem, and what residuals add to them.
#pragma once

#include <Eigen/Core>

#include "dqslam/linear/block_matrix.h"

namespace dqslam {

/// H step = -gradient is the Gauss-Newton step.
struct NormalEquations {
  double cost = 0;           ///< half the sum of the squared residuals, after the loss
  Eigen::VectorXd gradient;  ///< J^T r
  BlockMatrix H;             ///< J^T J
};

/// Adds residuals with their derivatives, block by block; a block below zero is constant.
class Accumulator {
 public:
  explicit Accumulator(NormalEquations* equations) : equations_(*equations), H_(equations_.H) {}

  /// What a residual says of one block. (Eigen's other product first copies 4 x 9 to be
  /// multiplied.)
  template <int kRows, int kColumns>
  void AddDiagonal(int block,
                   const Eigen::Matrix<double, kRows, kColumns>& J,
                   const Eigen::Matrix<double, kRows, 1>& residual) {
    if (block < 0) return;
    equations_.gradient.segment<kColumns>(H_.offset(block)).noalias() += J.transpose() * residual;
    Eigen::Map<Eigen::Matrix<double, kColumns, kColumns>>(H_.Diagonal(block)).noalias() +=
        J.transpose().lazyProduct(J);
  }

  /// How it couples two blocks: J_a and J_b in the order of their numbers.
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
