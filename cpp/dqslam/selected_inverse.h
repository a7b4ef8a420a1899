// Diagonal blocks of the inverse of a sparse symmetric positive definite matrix.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

namespace dqslam {

/// Blocks of H^-1 on the diagonal, of the given sizes in the order of H's rows.  Entries of the
/// inverse are computed on the pattern of the Cholesky factor only (Takahashi, Fagan & Chin 1973).
/// Entries of H within a block must be stored, zeros included.  Throws std::runtime_error when H is
/// not positive definite.
std::vector<Eigen::MatrixXd> DiagonalBlocksOfInverse(const Eigen::SparseMatrix<double>& H,
                                                     const std::vector<int>& block_sizes);

}  // namespace dqslam
