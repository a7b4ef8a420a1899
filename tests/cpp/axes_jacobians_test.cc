#include "dqslam/geometry/axes_jacobians.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 50;
constexpr double kStep = 1e-6;

// Axes that differ, so that each stays itself when the ellipsoid is perturbed.
Eigen::Vector3d DistinctAxes(Random& random) {
  return {random.Uniform(0.9, 1.2), random.Uniform(0.5, 0.8), random.Uniform(0.1, 0.4)};
}

// L = diag(2, 3, 4) and l10 turns both axes of its plane, which changes their lengths at second
// order only.
TEST(LogSemiAxesJacobian, OfAnUprightEllipsoidByHand) {
  Vector9d e;
  e << 1, 2, 3, std::log(2.0), std::log(3.0), std::log(4.0), 0, 0, 0;
  Eigen::Matrix<double, 3, 9> expected = Eigen::Matrix<double, 3, 9>::Zero();
  expected(0, 5) = expected(1, 4) = expected(2, 3) = 1;
  EXPECT_LT((LogSemiAxesJacobian(e) - expected).norm(), 1e-14);
}

TEST(LogSemiAxesJacobian, IsWhatPerturbationsShow) {
  Random random(1);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Vector9d e = EllipsoidFromAxes(
        random.UniformVector<3>(-2, 2), DistinctAxes(random), random.UnitQuaternion());
    const Eigen::Matrix<double, 3, 9> jacobian = LogSemiAxesJacobian(e);
    for (int k = 0; k < kLandmarkSize; ++k) {
      const Vector9d step = kStep * Vector9d::Unit(k);
      const Eigen::Vector3d change = AxesFromEllipsoid(e + step).semi_axes.cwiseQuotient(
          AxesFromEllipsoid(e - step).semi_axes);
      const Eigen::Vector3d expected = change.array().log() / (2 * kStep);
      EXPECT_LT((jacobian.col(k) - expected).norm(), 1e-6) << "parameter " << k;
    }
  }
}

TEST(ShapeFromAxesJacobian, IsWhatPerturbationsShow) {
  Random random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d axes = random.UniformVector<3>(0.1, 1.2);
    const Eigen::Vector4d orientation = random.UnitQuaternion();
    const Matrix6d jacobian = ShapeFromAxesJacobian(axes, orientation);
    const auto moved = [&](int k, double step) {
      Eigen::Vector3d grown = axes, turn = Eigen::Vector3d::Zero();
      if (k < 3) {
        grown[k] *= std::exp(step);
      } else {
        turn[k - 3] = step;
      }
      const Eigen::Quaterniond turned =
          Eigen::Quaterniond(orientation.data()) * ExpRotation<double>(turn);
      return Vector9d(EllipsoidFromAxes(Eigen::Vector3d::Zero(), grown, turned.coeffs()));
    };
    for (int k = 0; k < 6; ++k) {
      const Vector9d expected = (moved(k, kStep) - moved(k, -kStep)) / (2 * kStep);
      EXPECT_LT((jacobian.col(k) - expected.tail<6>()).norm(), 1e-6) << "column " << k;
    }
  }
}

// Lengths follow from the shape and the shape from the lengths; turns change none of them.
TEST(ShapeFromAxesJacobian, IsInvertedByTheOtherOne) {
  Random random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector3d axes = DistinctAxes(random);
    const Eigen::Vector4d orientation = random.UnitQuaternion();
    const Vector9d e = EllipsoidFromAxes(Eigen::Vector3d::Zero(), axes, orientation);
    const Eigen::Matrix<double, 3, 6> product =
        LogSemiAxesJacobian(e).rightCols<6>() * ShapeFromAxesJacobian(axes, orientation);
    EXPECT_LT((product - Eigen::Matrix<double, 3, 6>::Identity()).norm(), 1e-11);
  }
}

TEST(ShapeFromAxesJacobian, OfASphereDoesNotDependOnItsOrientation) {
  const Eigen::Matrix<double, 6, 3> by_turn =
      ShapeFromAxesJacobian({2, 2, 2}, {0.5, 0.5, 0.5, 0.5}).rightCols<3>();
  EXPECT_EQ(by_turn.cwiseAbs().maxCoeff(), 0);
}

TEST(ShapeFromAxesJacobian, RefusesWhatIsNoEllipsoid) {
  EXPECT_THROW(ShapeFromAxesJacobian({1, 0, 1}, {0, 0, 0, 1}), std::invalid_argument);
  EXPECT_THROW(ShapeFromAxesJacobian({1, 1, 1}, {0, 0, 0, 2}), std::invalid_argument);
}

}  // namespace
}  // namespace dqslam
