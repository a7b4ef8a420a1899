// Square root information: the one place where residuals are scaled.
//
//   r = W e,  W^T W = covariance^-1,  so that r^T r is the squared Mahalanobis distance of e.
//
// With covariance = C C^T (Cholesky), W = C^-1 has this property.
#pragma once

#include <Eigen/Cholesky>
#include <stdexcept>

#include "dqslam/blocks.h"

namespace dqslam {

/// W with W^T W = covariance^-1; throws std::invalid_argument unless positive definite.
template <int kSize>
Eigen::Matrix<double, kSize, kSize> SqrtInformation(
    const Eigen::Matrix<double, kSize, kSize>& covariance) {
  using Square = Eigen::Matrix<double, kSize, kSize>;
  const double asymmetry = (covariance - covariance.transpose()).cwiseAbs().maxCoeff();
  const Eigen::LLT<Square> cholesky(covariance);
  if (!covariance.allFinite() || asymmetry > 1e-9 * covariance.cwiseAbs().maxCoeff() ||
      cholesky.info() != Eigen::Success) {
    throw std::invalid_argument("covariance is not symmetric positive definite");
  }
  return cholesky.matrixL().solve(Square::Identity());
}

/// residual = W error, for AutoDiff scalars.
template <int kSize, typename T>
void Whiten(const Eigen::Matrix<double, kSize, kSize>& sqrt_information,
            const Eigen::Matrix<T, kSize, 1>& error, T* residual) {
  Eigen::Map<Eigen::Matrix<T, kSize, 1>>(residual).noalias() =
      sqrt_information.template cast<T>() * error;
}

}  // namespace dqslam
