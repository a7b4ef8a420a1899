// Cholesky factorization of a symmetric positive definite BlockMatrix.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "dqslam/linear/block_matrix.h"
#include "dqslam/linear/elimination.h"

namespace dqslam {

/// Multifrontal factorization A + diag(damping) = L L^T, which can be repeated whenever the values
/// of A change. It runs in one thread and gives the same bits each time.
class BlockCholesky {
 public:
  /// Of matrices with the pattern that was laid out.
  explicit BlockCholesky(std::shared_ptr<const Elimination> elimination, int threads = 1);
  /// Orders the blocks and lays out the factor. This needs only the pattern of A.
  explicit BlockCholesky(const BlockMatrix& A, int threads = 1)
      : BlockCholesky(std::make_shared<Elimination>(*A.pattern()), threads) {}

  /// Factorizes A + diag(damping). `A` must have the pattern that the constructor was given, and
  /// `damping` has one entry per row of A.
  /// Returns false, and leaves no factor, when the sum is not positive definite or not finite.
  /// Throws std::invalid_argument when sizes differ from those of the constructor's matrix.
  bool Factorize(const BlockMatrix& A, const Eigen::VectorXd& damping);

  /// (A + diag(damping))^-1 b. The last call of Factorize must have returned true.
  Eigen::VectorXd Solve(const Eigen::VectorXd& b) const;

  /// What the factor consists of, for those who need more of it than solutions.
  using Columns = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
  const Elimination& elimination() const { return *elimination_; }
  /// L of one front, at its pivots (undefined above the diagonal) and at the rows below them.
  Columns Pivots(int f) const;
  Columns Below(int f) const;
  /// The front that has a row, in the order of elimination, among its pivots.
  int FrontOf(int row) const;

 private:
  bool Eliminate(const BlockMatrix& A, const Eigen::VectorXd& placed_damping, int f);
  void PlaceBlocks(const BlockMatrix& A, int f);
  void AddUpdates(int f);

  double* Factor(int f) { return factor_.data() + elimination_->fronts[f].factor; }
  double* Update(int f) {
    const Front& front = elimination_->fronts[f];
    return stacks_[front.stack].data() + front.update;
  }

  std::shared_ptr<const Elimination> elimination_;
  int threads_;
  std::vector<int> others_;  // the fronts of no subtree, ascending
  // Of a large matrix, the thread that first writes to memory of these two gets its pages.
  Eigen::VectorXd factor_;  // each front's rows() x pivots, undefined above the diagonal
  std::vector<Eigen::VectorXd> stacks_;  // the updates that wait
};

}  // namespace dqslam
