// Entries of the inverse of a sparse symmetric positive definite matrix.
#pragma once

#include <Eigen/SparseCore>

namespace dqslam {

/// H^-1 on the pattern of the Cholesky factor of H (Takahashi, Fagan & Chin 1973). That pattern
/// contains the pattern of H.
class SelectedInverse {
 public:
  /// Throws std::runtime_error when H is not positive definite.
  explicit SelectedInverse(const Eigen::SparseMatrix<double>& H);

  /// An entry of H^-1 that H stores. For any other entry the result may be 0 instead of its value.
  double operator()(int row, int column) const;

  /// A square block on the diagonal of H^-1. H must store all entries of that block, also zeros.
  Eigen::MatrixXd Block(int start, int size) const;

 private:
  Eigen::SparseMatrix<double> inverse_;  // lower triangle, rows and columns in the factor's order
  Eigen::VectorXi place_;                // where the factor puts a row of H
};

}  // namespace dqslam
