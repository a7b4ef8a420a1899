#include "dqslam/geometry/manifolds.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace dqslam {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Jacobian9 = Eigen::Matrix<double, kLandmarkSize, kLandmarkSize, Eigen::RowMajor>;

Matrix3d Factor(const double* e) {
  Matrix3d L;
  L << std::exp(e[3]), 0, 0, e[6], std::exp(e[4]), 0, e[7], e[8], std::exp(e[5]);
  return L;
}

// 1 + x, and from x = -1/2 down a smooth way to stay positive.  The bounds are for steps that Ceres
// tries only to measure a gradient.
double Grow(double x) {
  return std::clamp(x > -0.5 ? 1 + x : -0.25 / x, 1e-4, 1e6);
}

// The x > -1 with Grow(x) = y.
double Shrink(double y) {
  return y > 0.5 ? y - 1 : -0.25 / y;
}

// A symmetric matrix with its eigenvalues changed.
using Change = double (*)(double);
Matrix3d ChangeEigenvalues(const Matrix3d& symmetric, Change change) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(symmetric);
  const Matrix3d& U = eigen.eigenvectors();
  return U * eigen.eigenvalues().unaryExpr(change).asDiagonal() * U.transpose();
}

}  // namespace

// S = L L^T moves to L (I + X + X^T) L^T with X = L^-1 dL; eigenvalues of the middle stay positive.
bool EllipsoidManifold::Plus(const double* ellipsoid, const double* tangent, double* result) const {
  const Matrix3d L = Factor(ellipsoid);
  Matrix3d dL = Matrix3d::Zero();
  for (int i = 0; i < 3; ++i) dL(i, i) = L(i, i) * tangent[3 + i];
  dL(1, 0) = tangent[6];
  dL(2, 0) = tangent[7];
  dL(2, 1) = tangent[8];
  const Matrix3d X = L.triangularView<Eigen::Lower>().solve(dL);
  const Eigen::LLT<Matrix3d> middle(ChangeEigenvalues(X + X.transpose(), Grow));
  const Matrix3d C = middle.matrixL();
  const Matrix3d moved = L * C;
  for (int i = 0; i < 3; ++i) {
    result[i] = ellipsoid[i] + tangent[i];
    result[3 + i] = ellipsoid[3 + i] + std::log(C(i, i));
  }
  result[6] = moved(1, 0);
  result[7] = moved(2, 0);
  result[8] = moved(2, 1);
  return middle.info() == Eigen::Success;
}

bool EllipsoidManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Jacobian9>(jacobian).setIdentity();
  return true;
}

bool EllipsoidManifold::Minus(const double* ellipsoid,
                              const double* origin,
                              double* tangent) const {
  const Matrix3d L = Factor(origin);
  const Matrix3d C = L.triangularView<Eigen::Lower>().solve(Factor(ellipsoid));
  Matrix3d X = ChangeEigenvalues(C * C.transpose(), Shrink);
  X.diagonal() *= 0.5;
  const Matrix3d dL = L * Matrix3d(X.triangularView<Eigen::Lower>());
  for (int i = 0; i < 3; ++i) {
    tangent[i] = ellipsoid[i] - origin[i];
    tangent[3 + i] = X(i, i);
  }
  tangent[6] = dL(1, 0);
  tangent[7] = dL(2, 0);
  tangent[8] = dL(2, 1);
  return true;
}

bool EllipsoidManifold::MinusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Jacobian9>(jacobian).setIdentity();
  return true;
}

}  // namespace dqslam
