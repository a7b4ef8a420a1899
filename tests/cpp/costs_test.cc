#include <gtest/gtest.h>

#include <array>

#include "cost_checks.h"
#include "dqslam/costs/odometry.h"
#include "dqslam/costs/size_prior.h"
#include "oracle.h"
#include "random.h"
#include "situation.h"

namespace dqslam {
namespace {

constexpr int kTrials = 25;

const Eigen::Matrix4d kPlain = Eigen::Matrix4d::Identity();

template <typename Models>
class BoxCosts : public testing::Test {
 protected:
  using World = Situation<typename Models::first_type, typename Models::second_type>;
  Random random_{1};
};

using AllModels = testing::Types<std::pair<Se2, EllipsoidModel>,
                                 std::pair<Se2, DualQuadricModel>,
                                 std::pair<Se3, EllipsoidModel>,
                                 std::pair<Se3, DualQuadricModel>>;
TYPED_TEST_SUITE(BoxCosts, AllModels);

TYPED_TEST(BoxCosts, JacobiansMatchPerturbation) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const typename TestFixture::World world(this->random_);
    const Eigen::Matrix4d weight = SqrtInformation<4>(this->random_.template Covariance<4>());
    const Eigen::Matrix3d weight3 = SqrtInformation<3>(this->random_.template Covariance<3>());
    ExpectJacobiansMatchPerturbation(*world.Algebraic(weight, false), world.Blocks());
    ExpectJacobiansMatchPerturbation(*world.Algebraic(weight, true), world.Blocks());
    ExpectJacobiansMatchPerturbation(*world.Tangent(weight), world.Blocks());
    ExpectJacobiansMatchPerturbation(*world.Box(weight), world.Blocks());
    ExpectJacobiansMatchPerturbation(*world.Position(weight3), world.Blocks());
  }
}

TYPED_TEST(BoxCosts, FullCovarianceMakesTheNormTheMahalanobisDistance) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const typename TestFixture::World world(this->random_);
    const Eigen::Matrix4d covariance = this->random_.template Covariance<4>();
    const Eigen::Matrix4d weight = SqrtInformation<4>(covariance);
    for (const bool normalized : {false, true}) {
      ExpectWhitened(*world.Algebraic(weight, normalized),
                     *world.Algebraic(kPlain, normalized),
                     covariance,
                     world.Blocks());
    }
    ExpectWhitened(*world.Tangent(weight), *world.Tangent(kPlain), covariance, world.Blocks());
    ExpectWhitened(*world.Box(weight), *world.Box(kPlain), covariance, world.Blocks());
    const Eigen::Matrix3d covariance3 = this->random_.template Covariance<3>();
    ExpectWhitened(*world.Position(SqrtInformation<3>(covariance3)),
                   *world.Position(Eigen::Matrix3d::Identity()),
                   covariance3,
                   world.Blocks());
  }
}

// [S&M17] eq. (5) with the matrices as the paper writes them: P = K [R t], l = x_a cross x_b.
TYPED_TEST(BoxCosts, AlgebraicIsThePapersProductOfMatrices) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const typename TestFixture::World world(this->random_);
    const Camera& camera = world.camera;
    const oracle::Ellipsoid& e = world.ellipsoid;
    const Eigen::Matrix3d R = oracle::RotationMatrix(e.orientation_xyzw);
    Eigen::Matrix4d object_pose = Eigen::Matrix4d::Identity();
    object_pose << R, e.center, 0, 0, 0, 1;
    Eigen::Vector4d dual = Eigen::Vector4d::Ones();
    dual.head<3>() = -e.semi_axes.cwiseAbs2();
    const Eigen::Matrix4d Q = object_pose * dual.asDiagonal() * object_pose.transpose();
    Eigen::Matrix3d K;
    K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
    Eigen::Matrix<double, 3, 4> P;
    P << world.view.rotation.transpose(), -world.view.rotation.transpose() * world.view.position;
    P = (K * P).eval();
    const Eigen::Matrix3d C = P * Q * P.transpose();
    const Eigen::Vector4d& b = world.observed;
    const Eigen::Vector3d corners[4] = {{b[0], b[3], 1},
                                        {b[0], b[1], 1},
                                        {b[2], b[1], 1},
                                        {b[2], b[3], 1}};  // from bottom left, clockwise
    Eigen::Vector4d expected;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d line = corners[k].cross(corners[(k + 1) % 4]);
      expected[k] = line.dot(C * line);
    }
    const Eigen::VectorXd raw = ResidualOf(*world.Algebraic(kPlain, false), world.Blocks());
    EXPECT_LT((raw - expected).norm(), 1e-9 * expected.norm());
    const Eigen::VectorXd normalized = ResidualOf(*world.Algebraic(kPlain, true), world.Blocks());
    EXPECT_LT((normalized - expected / C(2, 2)).norm(), 1e-9 * normalized.norm());
  }
}

// a = (n.p + h)(n.p - h): the tangent residual is the first factor, so with f = n.p + h,
// a = f (2 n.p - f), up to the scales of line and plane.
TYPED_TEST(BoxCosts, TangentIsAFactorOfAlgebraic) {
  const double depth = 4;
  for (int trial = 0; trial < kTrials; ++trial) {
    const typename TestFixture::World world(this->random_);
    const Camera& camera = world.camera;
    const Eigen::Vector4d& box = world.observed;
    const Eigen::VectorXd algebraic = ResidualOf(*world.Algebraic(kPlain, false), world.Blocks());
    const Eigen::VectorXd tangent = ResidualOf(*world.Tangent(kPlain, depth), world.Blocks());
    const Eigen::Vector3d p = world.view.ToCamera(world.ellipsoid.center);
    for (int edge = 0; edge < 4; ++edge) {
      const int axis = edge % 2;
      const double focal = axis == 0 ? camera.fx : camera.fy;
      const double x = (box[edge] - (axis == 0 ? camera.cx : camera.cy)) / focal;
      const double distance = (edge < 2 ? -1 : 1) * (p[axis] - x * p.z());
      const double factor = tangent[edge] * depth / focal;
      const double line_length = axis == 0 ? box[3] - box[1] : box[2] - box[0];
      const double expected = std::pow(line_length * focal, 2) * factor * (2 * distance - factor);
      EXPECT_NEAR(algebraic[edge], expected, 1e-8 * algebraic.norm());
    }
  }
}

TYPED_TEST(BoxCosts, BoxIsTheSampledBoxMinusTheObserved) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const typename TestFixture::World world(this->random_);
    const Eigen::Vector4d expected =
        oracle::Box(world.camera, world.view, world.ellipsoid) - world.observed;
    EXPECT_LT((ResidualOf(*world.Box(kPlain), world.Blocks()) - expected).norm(), 1e-6);
  }
}

// Left and bottom edge are cut by the border: beyond them the object may go on as it likes.
TYPED_TEST(BoxCosts, OneSidedEdgesCountOnlyWhereTheObjectEndsInside) {
  EdgeFlags one_sided;
  one_sided << true, false, false, true;
  const Eigen::Vector4d outward(-1, -1, 1, 1);
  int beyond = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const typename TestFixture::World world(this->random_);
    const Eigen::Vector4d box = ResidualOf(*world.Box(kPlain), world.Blocks());
    const Eigen::Vector4d tangent = ResidualOf(*world.Tangent(kPlain), world.Blocks());
    Eigen::Vector4d expected_box = box, expected_tangent = tangent;
    for (const int edge : {0, 3}) {
      if (outward[edge] * box[edge] <= 0) continue;
      expected_box[edge] = expected_tangent[edge] = 0;
      ++beyond;
    }
    EXPECT_EQ(ResidualOf(*world.Box(kPlain, one_sided), world.Blocks()), expected_box);
    EXPECT_EQ(ResidualOf(*world.Tangent(kPlain, 4.0, one_sided), world.Blocks()), expected_tangent);
    if (std::min(std::abs(box[0]), std::abs(box[3])) < 1) continue;  // a kink within the steps
    ExpectJacobiansMatchPerturbation(*world.Box(kPlain, one_sided), world.Blocks());
    ExpectJacobiansMatchPerturbation(*world.Tangent(kPlain, 4.0, one_sided), world.Blocks());
  }
  EXPECT_GT(beyond, 5);
  EXPECT_LT(beyond, 2 * kTrials - 5);
}

// Behind, around and across the camera: box and normalized algebraic refuse, the others do not.
TYPED_TEST(BoxCosts, FailWhereTheirGeometryIsImpossible) {
  for (const double depth : {-5.0, -0.1, 0.0, 0.1}) {
    typename TestFixture::World world(this->random_);
    world.Place({0.3, 0.2, depth}, this->random_);
    EXPECT_FALSE(IsDefined(*world.Box(kPlain), world.Blocks()));
    EXPECT_TRUE(IsDefined(*world.Tangent(kPlain), world.Blocks()));
    EXPECT_TRUE(IsDefined(*world.Algebraic(kPlain, false), world.Blocks()));
    const bool clear_of_the_focal_plane = depth == -5;
    EXPECT_EQ(IsDefined(*world.Algebraic(kPlain, true), world.Blocks()), clear_of_the_focal_plane);
  }
}

TEST(TangentCost, FailsForADualQuadricWithoutARealSurface) {
  Random random(2);
  Situation<Se3, DualQuadricModel> world(random);
  world.landmark << 1, 0, 0, 0, 1, 0, 0, 1, 0;  // Q* = I
  EXPECT_FALSE(IsDefined(*world.Tangent(kPlain), world.Blocks()));
  EXPECT_TRUE(IsDefined(*world.Algebraic(kPlain, false), world.Blocks()));
  ExpectJacobiansMatchPerturbation(*world.Algebraic(kPlain, false), world.Blocks());
}

// Robot at (1, 2), driving along +y; the object three ahead and half a meter up.
TEST(RelativePositionCost, ByHand) {
  const Eigen::Vector3d pose(1, 2, M_PI / 2), measured(3.1, -0.2, 0.4);
  const CostPointer cost(RelativePositionCost<Se2, EllipsoidModel>::Create(
      measured, Eigen::Matrix3d(Eigen::Matrix3d::Identity())));
  const Eigen::VectorXd residual =
      ResidualOf(*cost, {PoseBlock<Se2>(pose), LandmarkBlock(Sphere({1, 5, 0.5}, 0.3))});
  EXPECT_LT((residual - Eigen::Vector3d(0.1, -0.2, -0.1)).norm(), 1e-14);
}

}  // namespace
}  // namespace dqslam
