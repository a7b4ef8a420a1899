// Square root information: the one place where residuals are scaled.
//
//   r = W e,  W^T W = covariance^-1,  so that r^T r is the squared Mahalanobis distance of e.
//
// With covariance = C C^T (Cholesky), W = C^-1 has this property.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <stdexcept>

#include "dqslam/blocks.h"

namespace dqslam {

/// Whether a covariance is finite, symmetric and positive definite by a margin over rounding.  The
/// margin is that of the correlation matrix, so units do not matter.
template <int kSize>
bool IsCovariance(const Eigen::Matrix<double, kSize, kSize>& covariance) {
  using Square = Eigen::Matrix<double, kSize, kSize>;
  if (!covariance.allFinite() || !(covariance.diagonal().array() > 0).all()) return false;
  const Eigen::Matrix<double, kSize, 1> sigma = covariance.diagonal().cwiseSqrt();
  const Square correlation = covariance.array() / (sigma * sigma.transpose()).array();
  if ((correlation - correlation.transpose()).cwiseAbs().maxCoeff() > 1e-9) return false;
  const Eigen::SelfAdjointEigenSolver<Square> eigen(correlation, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()[0] > 1e-12;
}

/// W with W^T W = covariance^-1; throws std::invalid_argument unless positive definite.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> SqrtInformation(
    const Eigen::Matrix<double, kSize, kSize>& covariance) {
  using Square = Eigen::Matrix<double, kSize, kSize>;
  const Eigen::LLT<Square> cholesky(covariance);
  if (!IsCovariance(covariance) || cholesky.info() != Eigen::Success) {
    throw std::invalid_argument("covariance is not symmetric positive definite");
  }
  return cholesky.matrixL().solve(Square::Identity());
}

/// residual = W error, for AutoDiff scalars.
template <int kSize, typename T>
void Whiten(const Eigen::Matrix<double, kSize, kSize>& sqrt_information,
            const Eigen::Matrix<T, kSize, 1>& error,
            T* residual) {
  Eigen::Map<Eigen::Matrix<T, kSize, 1>>(residual).noalias() = sqrt_information * error;
}

}  // namespace dqslam
