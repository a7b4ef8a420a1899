// Entries of the inverse of a sparse symmetric positive definite matrix.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dqslam/linear/block_cholesky.h"
#include "dqslam/linear/block_matrix.h"

namespace dqslam {

/// A^-1 on the pattern of the Cholesky factor of A (Takahashi, Fagan & Chin 1973), front by front.
/// That pattern contains the pattern of A.
class SelectedInverse {
 public:
  /// `cholesky` is a factorization of A with whatever damping, which counts as a part of A.  Both
  /// must outlive the result.
  SelectedInverse(const BlockMatrix& A, const BlockCholesky& cholesky);

  /// Block (i, j) of A^-1.  Throws std::invalid_argument unless i == j or the factor couples them,
  /// as it does whenever A does.
  Eigen::MatrixXd Block(int i, int j) const;

 private:
  void Invert(int f);
  Eigen::MatrixXd Below(int f) const;

  const BlockMatrix& A_;
  const BlockCholesky& cholesky_;
  Eigen::VectorXd inverse_;  // each front's rows() x pivots, where the factor has the same front
};

/// The entries of A^-1 at some rows and the same columns, each coupled with each other or not, from
/// a factorization of A.  Takes time and memory for what is eliminated after these rows only.
Eigen::MatrixXd InverseAt(const BlockCholesky& cholesky, const std::vector<int>& rows);

}  // namespace dqslam
