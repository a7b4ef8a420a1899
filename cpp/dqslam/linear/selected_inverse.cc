#include "dqslam/linear/selected_inverse.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <stdexcept>

namespace dqslam {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// Entries of (L D L^T)^-1 on the pattern of L, stored like L with its unit diagonal:
//   Z_ij = [i = j] / d_j - sum_{k > j, L_kj != 0} Z_ik L_kj   for i >= j, last column first.
Sparse InverseOnPattern(const Sparse& L, const Eigen::VectorXd& D) {
  Sparse Z = L;
  const int* outer = L.outerIndexPtr();
  const int* inner = L.innerIndexPtr();
  const double* value = L.valuePtr();
  Eigen::VectorXd column = Eigen::VectorXd::Zero(L.rows());
  for (int j = static_cast<int>(L.cols()) - 1; j >= 0; --j) {
    const int begin = outer[j], end = outer[j + 1];  // the first entry is the diagonal
    for (int p = begin; p < end; ++p) column[inner[p]] = 0;
    // Z restricted to the rows of this column is symmetric: visit each stored entry once.
    for (int p = begin + 1; p < end; ++p) {
      const int k = inner[p];
      int r = begin + 1;
      for (int s = outer[k]; s < outer[k + 1]; ++s) {
        const int i = inner[s];
        while (r < end && inner[r] < i) ++r;
        if (r == end) break;
        if (inner[r] != i) continue;
        const double z = Z.valuePtr()[s];
        column[i] -= z * value[p];
        if (i != k) column[k] -= z * value[r];
      }
    }
    double diagonal = 1 / D[j];
    for (int p = begin + 1; p < end; ++p) {
      Z.valuePtr()[p] = column[inner[p]];
      diagonal -= value[p] * column[inner[p]];
    }
    Z.valuePtr()[begin] = diagonal;
  }
  return Z;
}

}  // namespace

SelectedInverse::SelectedInverse(const Sparse& H) {
  const Eigen::SimplicialLDLT<Sparse> factor(H);
  if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0)) {
    throw std::runtime_error("the information matrix is not positive definite");
  }
  // SimplicialLDLT keeps the unit diagonal implicit: store it.
  Sparse unit(H.rows(), H.cols());
  unit.setIdentity();
  const Sparse strict = factor.matrixL().nestedExpression().triangularView<Eigen::StrictlyLower>();
  Sparse L = strict + unit;
  L.makeCompressed();
  inverse_ = InverseOnPattern(L, factor.vectorD());
  place_ = factor.permutationP().indices();
}

double SelectedInverse::operator()(int row, int column) const {
  const int i = place_[row], j = place_[column];
  return inverse_.coeff(std::max(i, j), std::min(i, j));
}

Eigen::MatrixXd SelectedInverse::Block(int start, int size) const {
  return Eigen::MatrixXd::NullaryExpr(
      size, size, [&](int r, int c) { return (*this)(start + r, start + c); });
}

}  // namespace dqslam
