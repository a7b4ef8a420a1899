#include "dqslam/costs/size_prior.h"

#include <gtest/gtest.h>

#include "cost_checks.h"
#include "oracle.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 50;
constexpr double kLogMean = -0.7, kLogSigma = 0.6;

CostPointer Prior(double log_mean = kLogMean, double log_sigma = kLogSigma) {
  return CostPointer(SizePriorCost::Create(log_mean, log_sigma));
}

std::vector<Block> Object(const Eigen::Vector3d& semi_axes, const Eigen::Vector4d& orientation) {
  return {LandmarkBlock(EllipsoidFromAxes({1, 2, 3}, semi_axes, orientation))};
}

TEST(SizePriorCost, ByHandForAlignedAxes) {
  const Eigen::VectorXd residual = ResidualOf(*Prior(0, 0.5), Object({1, 2, 4}, {0, 0, 0, 1}));
  ASSERT_EQ(residual.size(), 6);
  EXPECT_NEAR(residual[0], 0, 1e-14);
  EXPECT_NEAR(residual[1], 2 * std::log(2.0), 1e-14);
  EXPECT_NEAR(residual[2], 2 * std::log(4.0), 1e-14);
  EXPECT_LT(residual.tail<3>().norm(), 1e-14);
}

TEST(SizePriorCost, IsZeroForTheSphereOfTheMeanSize) {
  const Vector9d sphere = Sphere({1, 2, 3}, std::exp(kLogMean));
  EXPECT_LT(ResidualOf(*Prior(), {LandmarkBlock(sphere)}).norm(), 1e-14);
}

TEST(SizePriorCost, SquaredNormIsThatOfTheLogSemiAxesInAnyOrientation) {
  Random random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d semi_axes = random.UniformVector<3>(0.05, 3);
    const double expected = ((semi_axes.array().log() - kLogMean) / kLogSigma).square().sum();
    for (int turn = 0; turn < 3; ++turn) {
      const Eigen::VectorXd residual =
          ResidualOf(*Prior(), Object(semi_axes, random.UnitQuaternion()));
      EXPECT_NEAR(residual.squaredNorm(), expected, 1e-10 * (1 + expected));
    }
  }
}

TEST(SizePriorCost, LogSigmaDividesTheResidual) {
  Random random(2);
  const std::vector<Block> object = Object({0.3, 0.5, 0.9}, random.UnitQuaternion());
  const Eigen::VectorXd once = ResidualOf(*Prior(kLogMean, 1), object);
  EXPECT_LT((ResidualOf(*Prior(kLogMean, 0.25), object) - 4 * once).norm(), 1e-14);
}

TEST(SizePriorCost, JacobianMatchesPerturbation) {
  Random random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    ExpectJacobiansMatchPerturbation(
        *Prior(), Object(random.UniformVector<3>(0.1, 1), random.UnitQuaternion()));
  }
}

// Equal axes, where eigenvectors have no derivative, and nearly equal ones.
TEST(SizePriorCost, JacobianMatchesPerturbationForEqualAxes) {
  Random random(4);
  for (const double difference : {0.0, 1e-12, 1e-8, 1e-5, 1e-4, 1e-3}) {
    for (int trial = 0; trial < 10; ++trial) {
      const Eigen::Vector4d orientation = random.UnitQuaternion();
      ExpectJacobiansMatchPerturbation(
          *Prior(), Object({0.4, 0.4 * (1 + difference), 0.4 * (1 - difference)}, orientation));
      ExpectJacobiansMatchPerturbation(*Prior(),
                                       Object({0.8, 0.4 * (1 + difference), 0.4}, orientation));
    }
  }
}

TEST(SizePriorCost, DoesNotPullTheCenter) {
  Random random(5);
  const Eigen::MatrixXd jacobian =
      AutoDiffJacobian(*Prior(), Object({0.3, 0.5, 0.9}, random.UnitQuaternion()), 0);
  EXPECT_TRUE(jacobian.leftCols<3>().isZero(0));
}

// Both with and without derivatives: Ceres asks for either.
TEST(SizePriorCost, FailsForANeedleAndADisc) {
  const auto is_defined = [](const Eigen::Vector3d& semi_axes) {
    Vector9d e = Sphere(Eigen::Vector3d::Zero(), 1);
    e.segment<3>(3) = semi_axes.array().log();
    const double* parameters[1] = {e.data()};
    double residual[6], jacobian[6 * 9];
    double* jacobians[1] = {jacobian};
    const bool without = Prior()->Evaluate(parameters, residual, nullptr);
    EXPECT_EQ(Prior()->Evaluate(parameters, residual, jacobians), without);
    return without;
  };
  EXPECT_TRUE(is_defined({1, 1e-4, 1e-4}));
  EXPECT_FALSE(is_defined({1, 1e-6, 1e-6}));
  EXPECT_FALSE(is_defined({1, 1, 1e-6}));
  EXPECT_FALSE(is_defined({1e6, 1, 1}));
}

TEST(SizePriorCost, FailsForNan) {
  EXPECT_FALSE(IsDefined(*Prior(), {LandmarkBlock(Vector9d::Constant(std::nan("")))}));
}

}  // namespace
}  // namespace dqslam
