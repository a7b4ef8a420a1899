#include "dqslam/costs/whitening.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>

#include "random.h"

namespace dqslam {
namespace {

TEST(SqrtInformation, IsOneOverSigmaForADiagonalCovariance) {
  const Eigen::Matrix2d covariance = Eigen::Vector2d(4, 0.25).asDiagonal();
  const Eigen::Matrix2d W = SqrtInformation<2>(covariance);
  EXPECT_TRUE(W.isApprox(Eigen::Matrix2d(Eigen::Vector2d(0.5, 2).asDiagonal()), 1e-15)) << W;
}

// covariance = [4 2; 2 2] = C C^T with C = [2 0; 1 1], so W = C^-1 = [1/2 0; -1/2 1].
TEST(SqrtInformation, OfAFullCovarianceByHand) {
  const Eigen::Matrix2d covariance = (Eigen::Matrix2d() << 4, 2, 2, 2).finished();
  const Eigen::Matrix2d expected = (Eigen::Matrix2d() << 0.5, 0, -0.5, 1).finished();
  EXPECT_TRUE(SqrtInformation<2>(covariance).isApprox(expected, 1e-15));
}

template <int kSize>
void ExpectSquareIsInverse(unsigned seed) {
  Random random(seed);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix<double, kSize, kSize> covariance = random.Covariance<kSize>();
    const Eigen::Matrix<double, kSize, kSize> W = SqrtInformation<kSize>(covariance);
    EXPECT_TRUE((W.transpose() * W).isApprox(covariance.inverse(), 1e-10)) << covariance;
  }
}

TEST(SqrtInformation, SquareIsTheInverseOfARandomCovariance) {
  ExpectSquareIsInverse<3>(1);
  ExpectSquareIsInverse<4>(2);
  ExpectSquareIsInverse<6>(3);
}

TEST(SqrtInformation, TakesMixedUnits) {
  const Eigen::Matrix3d covariance = Eigen::Vector3d(1e-12, 1, 1e8).asDiagonal();
  EXPECT_TRUE(SqrtInformation<3>(covariance).diagonal().isApprox(Eigen::Vector3d(1e6, 1, 1e-4)));
}

TEST(Whiten, MakesTheMahalanobisDistanceTheNorm) {
  Random random(4);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix4d covariance = random.Covariance<4>();
    const Eigen::Vector4d error = random.UniformVector<4>(-5, 5);
    Eigen::Vector4d residual;
    Whiten(SqrtInformation<4>(covariance), error, residual.data());
    const double mahalanobis_squared = error.dot(covariance.inverse() * error);
    EXPECT_NEAR(residual.squaredNorm(), mahalanobis_squared, 1e-10 * mahalanobis_squared);
  }
}

void ExpectRefused(const Eigen::Matrix3d& covariance) {
  EXPECT_THROW(SqrtInformation<3>(covariance), std::invalid_argument) << covariance;
}

TEST(SqrtInformation, RefusesWhatIsNotPositiveDefinite) {
  ExpectRefused(Eigen::Matrix3d::Zero());
  ExpectRefused(-Eigen::Matrix3d::Identity());
  ExpectRefused(Eigen::Vector3d(1, 0, 1).asDiagonal());
  ExpectRefused(Eigen::Vector3d(1, -1, 1).asDiagonal());
  ExpectRefused(Eigen::Matrix3d::Ones());  // rank one
}

// Rounding leaves pivots of either sign: a singular covariance must not pass by luck.
TEST(SqrtInformation, RefusesSingularCovariances) {
  Random random(5);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix<double, 3, 2> root =
        Eigen::Matrix<double, 3, 2>::NullaryExpr([&] { return random.Normal(); });
    ExpectRefused(root * root.transpose());
  }
}

TEST(SqrtInformation, RefusesAsymmetry) {
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  covariance(0, 1) = 1e-3;
  ExpectRefused(covariance);
}

TEST(SqrtInformation, RefusesNanAndInfinity) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
    covariance(1, 1) = bad;
    ExpectRefused(covariance);
    covariance = Eigen::Matrix3d::Identity();
    covariance(0, 2) = covariance(2, 0) = bad;
    ExpectRefused(covariance);
  }
}

}  // namespace
}  // namespace dqslam
