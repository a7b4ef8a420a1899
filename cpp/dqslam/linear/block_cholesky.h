// Cholesky factorization of a symmetric positive definite BlockMatrix.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dqslam/linear/block_matrix.h"
#include "dqslam/linear/elimination.h"

namespace dqslam {

/// A + diag(damping) = L L^T, multifrontal, as often as the values of A change. One thread; the
/// same bits each time.
class BlockCholesky {
 public:
  /// Orders the blocks and lays out the factor, from the pattern of A alone.
  explicit BlockCholesky(const BlockMatrix& A);

  /// `A` has the pattern that the constructor saw; one damping per row.
  /// False when A + diag(damping) is not positive definite or not finite: then there is no factor.
  /// Throws std::invalid_argument when sizes differ from those of the constructor's matrix.
  bool Factorize(const BlockMatrix& A, const Eigen::VectorXd& damping);

  /// (A + diag(damping))^-1 b of the last call of Factorize, which must have returned true.
  Eigen::VectorXd Solve(const Eigen::VectorXd& b) const;

 private:
  void PlaceBlocks(const BlockMatrix& A, int f);
  void AddUpdates(int f);

  double* Factor(int f) { return factor_.data() + elimination_.fronts[f].factor; }
  double* Update(int f) {
    const Front& front = elimination_.fronts[f];
    return stacks_[front.stack].data() + front.update;
  }

  Elimination elimination_;
  std::vector<double> factor_;     // of each front rows() x pivots; garbage above the diagonal
  std::vector<double> stacks_[2];  // updates
};

}  // namespace dqslam
