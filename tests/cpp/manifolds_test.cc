#include "dqslam/geometry/manifolds.h"

#include <ceres/manifold_test_utils.h>

#include "random.h"

namespace dqslam {
namespace {

using namespace ceres;  // Ceres' matchers and the Vector that its macro expects.

template <typename Pose>
class Manifolds : public testing::Test {
 protected:
  PoseManifold<Pose> manifold_;
  Random random_{1};
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(Manifolds, PoseTypes);

TYPED_TEST(Manifolds, SizesAreThoseOfTheModel) {
  EXPECT_EQ(this->manifold_.AmbientSize(), TypeParam::kSize);
  EXPECT_EQ(this->manifold_.TangentSize(), TypeParam::kTangentSize);
}

// Angles up to just below pi: beyond it the tangent is not unique.
TYPED_TEST(Manifolds, InvariantsHoldAtRandomPoints) {
  for (const double max_angle : {1e-9, 1e-3, 1.0, M_PI - 1e-6}) {
    for (int trial = 0; trial < 30; ++trial) {
      const Vector x = this->random_.template RandomPose<TypeParam>();
      const Vector delta = this->random_.template RandomTangent<TypeParam>(max_angle);
      const Vector towards_y = this->random_.template RandomTangent<TypeParam>(max_angle);
      Vector y(TypeParam::kSize);
      Plus<TypeParam>(x.data(), towards_y.data(), y.data());
      EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(this->manifold_, x, delta, y, 1e-9);
    }
  }
}

// Rotations by exactly pi from the identity, about the axes and about a diagonal.
TEST(Se3Manifold, InvariantsHoldAtHalfTurns) {
  const PoseManifold<Se3> manifold;
  Random random(2);
  for (const Vector3<double>& axis : {Vector3<double>(1, 0, 0),
                                      Vector3<double>(0, 1, 0),
                                      Vector3<double>(0, 0, 1),
                                      Vector3<double>(0.6, -0.8, 0)}) {
    Vector x(7);
    x << 1, 2, 3, axis, 0;
    const Vector delta = random.RandomTangent<Se3>(1);
    Vector y(7);
    Plus<Se3>(x.data(), delta.data(), y.data());
    EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(manifold, x, delta, y, 1e-9);
  }
}

TEST(Se3Manifold, PlusKeepsTheQuaternionUnit) {
  const PoseManifold<Se3> manifold;
  Random random(3);
  Vector x = random.RandomPose<Se3>();
  for (int step = 0; step < 1000; ++step) {
    const Vector delta = random.RandomTangent<Se3>(3);
    Vector next(7);
    ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), next.data()));
    x = next;
  }
  EXPECT_NEAR(x.tail(4).norm(), 1, 1e-13);
}

Vector RandomEllipsoid(Random& random) {
  return EllipsoidFromAxes(
      random.UniformVector<3>(-3, 3), random.UniformVector<3>(0.1, 2), random.UnitQuaternion());
}

TEST(EllipsoidManifold, InvariantsHoldAtRandomEllipsoids) {
  const EllipsoidManifold manifold;
  Random random(4);
  for (const double size : {1e-6, 1e-2, 0.1}) {
    for (int trial = 0; trial < 30; ++trial) {
      const Vector x = RandomEllipsoid(random);
      const Vector delta = size * random.UniformVector<9>(-1, 1);
      const Vector y = RandomEllipsoid(random);
      EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(manifold, x, delta, y, 1e-8);
    }
  }
}

// From the unit sphere, l20 moves S_xz and nothing else: (1 + t a)^T would add t^2 to S_zz.
TEST(EllipsoidManifold, MovesTheShapeInAStraightLine) {
  const EllipsoidManifold manifold;
  const Vector sphere = Vector::Zero(9);
  Vector moved(9);
  ASSERT_TRUE(manifold.Plus(sphere.data(), Vector(0.3 * Vector::Unit(9, 7)).data(), moved.data()));
  Eigen::Matrix3d expected = Eigen::Matrix3d::Identity();
  expected(0, 2) = expected(2, 0) = 0.3;
  EXPECT_TRUE(EllipsoidModel::Unpack(moved.data()).shape.isApprox(expected, 1e-14));
}

TEST(EllipsoidManifold, StaysAnEllipsoidHoweverLongTheStep) {
  const EllipsoidManifold manifold;
  Random random(5);
  for (const double size : {1.0, 1e2, 1e4}) {
    for (int trial = 0; trial < 30; ++trial) {
      const Vector x = RandomEllipsoid(random), delta = size * random.UniformVector<9>(-1, 1);
      Vector moved(9);
      ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), moved.data()));
      EXPECT_TRUE(moved.allFinite()) << moved.transpose();
    }
  }
}

}  // namespace
}  // namespace dqslam
