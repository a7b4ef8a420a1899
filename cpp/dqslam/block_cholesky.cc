#include "dqslam/block_cholesky.h"

namespace dqslam {
namespace {

Eigen::SparseMatrix<double> LowerTriangle(const BlockMatrix& A, const Eigen::VectorXd& damping) {
  std::vector<Eigen::Triplet<double>> entries;
  for (int b = 0; b < A.num_blocks(); ++b) {
    for (int c = 0; c < A.size(b); ++c) {
      for (int r = c; r < A.size(b); ++r) {
        const double damped = r == c ? damping[A.offset(b) + r] : 0.0;
        entries.emplace_back(
            A.offset(b) + r, A.offset(b) + c, A.Diagonal(b)[c * A.size(b) + r] + damped);
      }
    }
  }
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    for (int c = 0; c < A.size(j); ++c) {
      for (int r = 0; r < A.size(i); ++r) {
        entries.emplace_back(
            A.offset(j) + c, A.offset(i) + r, A.OffDiagonal(index)[c * A.size(i) + r]);
      }
    }
  }
  Eigen::SparseMatrix<double> lower(A.rows(), A.rows());
  lower.setFromTriplets(entries.begin(), entries.end());
  return lower;
}

}  // namespace

BlockCholesky::BlockCholesky(const BlockMatrix& A) {
  factor_.analyzePattern(LowerTriangle(A, Eigen::VectorXd::Ones(A.rows())));
}

bool BlockCholesky::Factorize(const BlockMatrix& A, const Eigen::VectorXd& damping) {
  const Eigen::SparseMatrix<double> lower = LowerTriangle(A, damping);
  if (!Eigen::Map<const Eigen::VectorXd>(lower.valuePtr(), lower.nonZeros()).allFinite()) {
    return false;
  }
  factor_.factorize(lower);
  return factor_.info() == Eigen::Success;
}

Eigen::VectorXd BlockCholesky::Solve(const Eigen::VectorXd& b) const {
  return factor_.solve(b);
}

}  // namespace dqslam
