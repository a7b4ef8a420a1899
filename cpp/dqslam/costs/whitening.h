// Square root information.  Residuals are scaled here and nowhere else.
//
//   r = W e,  W^T W = covariance^-1,  so that r^T r is the squared Mahalanobis distance of e.
//
// With covariance = C C^T (Cholesky), W = C^-1 has this property.
#pragma once

#include <Eigen/Cholesky>
#include <stdexcept>
#include <string>

#include "dqslam/geometry/blocks.h"

namespace dqslam {

/// W with W^T W = covariance^-1.  Throws std::invalid_argument unless the covariance is finite,
/// symmetric and positive definite by a margin over rounding.  The margin is tested on the
/// correlation matrix, so units do not matter.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> SqrtInformation(
    const Eigen::Matrix<double, kSize, kSize>& covariance) {
  using Square = Eigen::Matrix<double, kSize, kSize>;
  const Eigen::Matrix<double, kSize, 1> information =
      covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Square correlation = information.asDiagonal() * covariance * information.asDiagonal();
  const Eigen::LLT<Square> cholesky(correlation);
  const Square L = cholesky.matrixL();
  const bool positive_definite = covariance.allFinite() && information.allFinite() &&
                                 cholesky.info() == Eigen::Success &&
                                 L.diagonal().minCoeff() > 1e-6;
  if (!positive_definite || (correlation - correlation.transpose()).cwiseAbs().maxCoeff() > 1e-9) {
    throw std::invalid_argument("covariance is not symmetric positive definite");
  }
  const Square scale = information.asDiagonal();
  return L.template triangularView<Eigen::Lower>().solve(scale);
}

/// The same of one row of a table of covariances, (n, k * k); the exception names both.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> SqrtInformationOfRow(const std::string& table,
                                                         const RowMatrix& covariances,
                                                         Eigen::Index row) {
  using Square = Eigen::Matrix<double, kSize, kSize, Eigen::RowMajor>;
  try {
    return SqrtInformation<kSize>(Eigen::Map<const Square>(covariances.row(row).data()));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(table + " row " + std::to_string(row) + ": " + error.what());
  }
}

/// residual = W error, for AutoDiff scalars.
template <int kSize, typename T>
void Whiten(const Eigen::Matrix<double, kSize, kSize>& sqrt_information,
            const Eigen::Matrix<T, kSize, 1>& error,
            T* residual) {
  Eigen::Map<Eigen::Matrix<T, kSize, 1>>(residual).noalias() = sqrt_information * error;
}

}  // namespace dqslam
