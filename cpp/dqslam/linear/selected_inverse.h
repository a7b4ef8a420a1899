// Entries of the inverse of a sparse symmetric positive definite matrix.
#pragma once

#include <Eigen/SparseCore>

namespace dqslam {

/// H^-1 on the pattern of its Cholesky factor (Takahashi, Fagan & Chin 1973), which holds that of
/// H.
class SelectedInverse {
 public:
  /// Throws std::runtime_error when H is not positive definite.
  explicit SelectedInverse(const Eigen::SparseMatrix<double>& H);

  /// An entry that H stores; others may be 0 instead of what they are.
  double operator()(int row, int column) const;

  /// Square block on the diagonal, all of whose entries H stores, zeros included.
  Eigen::MatrixXd Block(int start, int size) const;

 private:
  Eigen::SparseMatrix<double> inverse_;  // lower triangle, rows and columns in the factor's order
  Eigen::VectorXi place_;                // where the factor puts a row of H
};

}  // namespace dqslam
