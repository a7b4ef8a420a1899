// Broad prior on the size:  r = (log(S) / 2 - log_mean I) / log_sigma, as a 6-vector with the same
// norm as the matrix.  With semi-axes a_i:  |r|^2 = sum_i (log a_i - log_mean)^2 / log_sigma^2, for
// any orientation of the object and of the world frame.
//
// Blocks: ellipsoid [9].  Residual: [6], in sigmas.
// Returns false where the ratio of the longest to the shortest semi-axis exceeds 10^5.  Such a disc
// or needle comes from a bad step, and its eigenvalues have no accurate digits left.
#pragma once

#include <ceres/jet.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

/// Largest ratio of eigenvalues for which their logarithms are accurate.  Eigenvalues are squared
/// semi-axes.
inline constexpr double kMaxEigenvalueRatio = 1e10;

/// Matrix logarithm of a symmetric positive definite matrix.  Returns false for any other matrix.
inline bool LogSymmetric(const Matrix3<double>& S, Matrix3<double>* log) {
  const Eigen::SelfAdjointEigenSolver<Matrix3<double>> eigen(S);
  if (!(eigen.eigenvalues()[0] * kMaxEigenvalueRatio > eigen.eigenvalues()[2])) return false;
  const Matrix3<double>& U = eigen.eigenvectors();
  *log = U * eigen.eigenvalues().array().log().matrix().asDiagonal() * U.transpose();
  return true;
}

/// Matrix logarithm with derivatives, by the Daleckii-Krein theorem.  In the eigenbasis, the
/// derivative of entry (i, j) is scaled by (log a_i - log a_j) / (a_i - a_j), or by 1 / a_i where
/// a_i = a_j.
template <int N>
bool LogSymmetric(const Matrix3<ceres::Jet<double, N>>& S, Matrix3<ceres::Jet<double, N>>* log) {
  Matrix3<double> value;
  for (int i = 0; i < 9; ++i) value(i) = S(i).a;
  const Eigen::SelfAdjointEigenSolver<Matrix3<double>> eigen(value);
  const Eigen::Vector3d& a = eigen.eigenvalues();
  if (!(a[0] * kMaxEigenvalueRatio > a[2])) return false;
  const Matrix3<double>& U = eigen.eigenvectors();
  Matrix3<double> divided;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double t = (a[i] - a[j]) / (a[i] + a[j]);  // log(a_i / a_j) = 2 atanh(t)
      const double ratio = std::abs(t) < 1e-4 ? 1 + t * t / 3 : std::atanh(t) / t;
      divided(i, j) = 2 * ratio / (a[i] + a[j]);
    }
  }
  const Matrix3<double> log_value = U * a.array().log().matrix().asDiagonal() * U.transpose();
  for (int i = 0; i < 9; ++i) (*log)(i).a = log_value(i);
  for (int k = 0; k < N; ++k) {
    Matrix3<double> derivative;
    for (int i = 0; i < 9; ++i) derivative(i) = S(i).v[k];
    const Matrix3<double> in_basis = U.transpose() * derivative * U;
    const Matrix3<double> result = U * in_basis.cwiseProduct(divided) * U.transpose();
    for (int i = 0; i < 9; ++i) (*log)(i).v[k] = result(i);
  }
  return true;
}

struct SizePriorCost : AutoDiffCost<SizePriorCost, 6, kLandmarkSize> {
  double log_mean;   ///< log meters
  double log_sigma;  ///< log meters

  template <typename T>
  bool operator()(const T* ellipsoid, T* residual) const {
    Matrix3<T> log;
    if (!LogSymmetric(EllipsoidModel::Unpack(ellipsoid).shape, &log)) return false;
    const double scale = 1 / log_sigma;
    for (int i = 0; i < 3; ++i) {
      residual[i] = T(scale) * (T(0.5) * log(i, i) - T(log_mean));
      residual[3 + i] = T(scale * std::sqrt(0.5)) * log(i, (i + 1) % 3);
    }
    return true;
  }
};

}  // namespace dqslam
