#include "dqslam/costs/odometry.h"

#include <gtest/gtest.h>

#include "cost_checks.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 50;

template <typename Pose>
class OdometryCosts : public testing::Test {
 protected:
  using Vector = Eigen::Matrix<double, Pose::kSize, 1>;
  using Tangent = Eigen::Matrix<double, Pose::kTangentSize, 1>;
  using Square = Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>;

  /// Two poses and what the odometry says, wrong by a tangent of up to `max_angle`.
  void Draw(double max_angle) {
    from_ = random_.RandomPose<Pose>();
    relative_ = random_.RandomPose<Pose>();
    error_ = random_.RandomTangent<Pose>(max_angle);
    Vector predicted;
    Pose::Compose(from_.data(), relative_.data(), predicted.data());
    Plus<Pose>(predicted.data(), Tangent(-error_).data(), to_.data());
  }
  CostPointer Cost(const Square& weight) const {
    return CostPointer(OdometryCost<Pose>::Create(relative_, weight));
  }
  std::vector<Block> Blocks() const { return {PoseBlock<Pose>(from_), PoseBlock<Pose>(to_)}; }

  Random random_{1};
  Vector from_, to_, relative_;
  Tangent error_;
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(OdometryCosts, PoseTypes);

TYPED_TEST(OdometryCosts, JacobiansMatchPerturbation) {
  for (const double max_angle : {1e-12, 0.1, 3.0}) {
    for (int trial = 0; trial < kTrials; ++trial) {
      this->Draw(max_angle);
      const auto covariance = this->random_.template Covariance<TypeParam::kTangentSize>();
      const auto weight = SqrtInformation<TypeParam::kTangentSize>(covariance);
      ExpectJacobiansMatchPerturbation(*this->Cost(weight), this->Blocks());
    }
  }
}

TYPED_TEST(OdometryCosts, FullCovarianceMakesTheNormTheMahalanobisDistance) {
  for (int trial = 0; trial < kTrials; ++trial) {
    this->Draw(1);
    const auto covariance = this->random_.template Covariance<TypeParam::kTangentSize>();
    const auto weight = SqrtInformation<TypeParam::kTangentSize>(covariance);
    ExpectWhitened(*this->Cost(weight),
                   *this->Cost(TestFixture::Square::Identity()),
                   covariance,
                   this->Blocks());
  }
}

// Exactly zero rotation is where the derivative of a norm does not exist.
TYPED_TEST(OdometryCosts, AtPerfectOdometryTheResidualIsZeroAndItsJacobianFinite) {
  for (int trial = 0; trial < kTrials; ++trial) {
    this->Draw(0);
    TypeParam::Compose(this->from_.data(), this->relative_.data(), this->to_.data());
    const CostPointer cost = this->Cost(TestFixture::Square::Identity());
    EXPECT_LT(ResidualOf(*cost, this->Blocks()).norm(), 1e-14);
    const Eigen::MatrixXd by_to = AutoDiffJacobian(*cost, this->Blocks(), 1);
    EXPECT_TRUE(by_to.isApprox(-Eigen::MatrixXd(TestFixture::Square::Identity()), 1e-13)) << by_to;
  }
}

// The world frame does not matter: the residual is the same after any rigid motion.
TYPED_TEST(OdometryCosts, DoesNotDependOnTheWorldFrame) {
  for (int trial = 0; trial < kTrials; ++trial) {
    this->Draw(1);
    const CostPointer cost = this->Cost(TestFixture::Square::Identity());
    const Eigen::VectorXd before = ResidualOf(*cost, this->Blocks());
    const auto motion = this->random_.template RandomPose<TypeParam>();
    for (auto* pose : {&this->from_, &this->to_}) {
      typename TestFixture::Vector moved;
      TypeParam::Compose(motion.data(), pose->data(), moved.data());
      *pose = moved;
    }
    EXPECT_LT((ResidualOf(*cost, this->Blocks()) - before).norm(), 1e-12);
  }
}

// [S&M17] f(x, (v, omega)): 1 m ahead, then 0.1 rad to the left; the next pose stands elsewhere.
TEST(OdometryCost, Se2ByHand) {
  const Eigen::Vector3d from(0, 0, 0), relative(1, 0, 0.1), to(1.1, 0.2, M_PI / 2);
  const Eigen::Matrix3d weight = Eigen::Vector3d(1, 2, 3).asDiagonal();
  const CostPointer cost(OdometryCost<Se2>::Create(relative, weight));
  const Eigen::VectorXd residual = ResidualOf(*cost, {PoseBlock<Se2>(from), PoseBlock<Se2>(to)});
  // (-0.1, -0.2) in the frame of `to`, whose x is the world's y.
  const Eigen::Vector3d expected(-0.2, 2 * 0.1, 3 * (0.1 - M_PI / 2));
  EXPECT_LT((residual - expected).norm(), 1e-14) << residual.transpose();
}

TEST(OdometryCost, Se3ByHand) {
  Eigen::Matrix<double, 7, 1> from, relative, to;
  from << 0, 0, 0, 0, 0, 0, 1;
  relative << 1, 0, 0, 0, 0, 0, 1;
  to << 1, 0.5, 0, 0, 0, M_SQRT1_2, M_SQRT1_2;  // turned left by 90 degrees
  const Eigen::Matrix<double, 6, 6> weight = Eigen::Matrix<double, 6, 6>::Identity();
  const CostPointer cost(OdometryCost<Se3>::Create(relative, weight));
  const Eigen::VectorXd residual = ResidualOf(*cost, {PoseBlock<Se3>(from), PoseBlock<Se3>(to)});
  Eigen::Matrix<double, 6, 1> expected;
  expected << -0.5, 0, 0, 0, 0, -M_PI / 2;
  EXPECT_LT((residual - expected).norm(), 1e-14) << residual.transpose();
}

TEST(OdometryCost, Se2WrapsTheAngle) {
  const Eigen::Vector3d from(0, 0, 3.1), relative(0, 0, 0.1), to(0, 0, 3.2 - 2 * M_PI);
  const Eigen::Matrix3d weight = Eigen::Matrix3d::Identity();
  const CostPointer cost(OdometryCost<Se2>::Create(relative, weight));
  EXPECT_LT(ResidualOf(*cost, {PoseBlock<Se2>(from), PoseBlock<Se2>(to)}).norm(), 1e-14);
}

}  // namespace
}  // namespace dqslam
