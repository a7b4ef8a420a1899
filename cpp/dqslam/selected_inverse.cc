#include "dqslam/selected_inverse.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <stdexcept>

namespace dqslam {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// Entries of (L D L^T)^-1 on the pattern of L, stored like L with its unit diagonal:
//   Z_ij = [i = j] / d_j - sum_{k > j, L_kj != 0} Z_ik L_kj   for i >= j, last column first.
class InverseOnPattern {
 public:
  InverseOnPattern(const Sparse& L, const Eigen::VectorXd& D) : Z_(L) {
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
          const double z = Z_.valuePtr()[s];
          column[i] -= z * value[p];
          if (i != k) column[k] -= z * value[r];
        }
      }
      double diagonal = 1 / D[j];
      for (int p = begin + 1; p < end; ++p) {
        Z_.valuePtr()[p] = column[inner[p]];
        diagonal -= value[p] * column[inner[p]];
      }
      Z_.valuePtr()[begin] = diagonal;
    }
  }

  double operator()(int i, int j) const { return Z_.coeff(std::max(i, j), std::min(i, j)); }

 private:
  Sparse Z_;
};

}  // namespace

std::vector<Eigen::MatrixXd> DiagonalBlocksOfInverse(const Sparse& H,
                                                     const std::vector<int>& block_sizes) {
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
  const InverseOnPattern Z(L, factor.vectorD());
  const auto& place = factor.permutationP().indices();

  std::vector<Eigen::MatrixXd> blocks;
  int offset = 0;
  for (const int size : block_sizes) {
    Eigen::MatrixXd block(size, size);
    for (int r = 0; r < size; ++r) {
      for (int c = 0; c < size; ++c) block(r, c) = Z(place[offset + r], place[offset + c]);
    }
    blocks.push_back(block);
    offset += size;
  }
  return blocks;
}

}  // namespace dqslam
