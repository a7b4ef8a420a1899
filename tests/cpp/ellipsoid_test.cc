// Conversions of ellipsoid.h; projection is in projection_test.cc.
#include "dqslam/geometry/ellipsoid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "oracle.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 100;

oracle::Ellipsoid RandomEllipsoid(Random& random, const Eigen::Vector3d& center) {
  return {center, random.UniformVector<3>(0.1, 1.2), random.UnitQuaternion()};
}

Surface<double> SurfaceOf(const oracle::Ellipsoid& e) {
  const Vector9d parameters = EllipsoidFromAxes(e.center, e.semi_axes, e.orientation_xyzw);
  return EllipsoidModel::Unpack(parameters.data());
}

// c = (1, 2, 3), S = diag(4, 9, 16): Q*_33 = c c^T - S.
TEST(DualQuadric, ByHandBothWays) {
  const Vector9d e =
      (Vector9d() << 1, 2, 3, std::log(2.0), std::log(3.0), std::log(4.0), 0, 0, 0).finished();
  const Vector9d q = (Vector9d() << 1 - 4, 2, 3, 1, 4 - 9, 6, 2, 9 - 16, 3).finished();
  EXPECT_LT((DualQuadricFromEllipsoid(e) - q).norm(), 1e-14);
  EXPECT_LT((EllipsoidFromDualQuadric(q) - e).norm(), 1e-14);
}

TEST(DualQuadric, ConversionsAreExactBothWays) {
  Random random(6);
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid a = RandomEllipsoid(random, random.UniformVector<3>(-2, 2));
    const Vector9d e = EllipsoidFromAxes(a.center, a.semi_axes, a.orientation_xyzw);
    const Vector9d q = DualQuadricFromEllipsoid(e);
    EXPECT_LT((EllipsoidFromDualQuadric(q) - e).norm(), 1e-11);
    EXPECT_LT((DualQuadricFromEllipsoid(EllipsoidFromDualQuadric(q)) - q).norm(), 1e-13);
  }
}

// A plane pi with pi^T Q* pi = 0 touches the surface: here at sampled points, normal included.
TEST(DualQuadric, VanishesOnTangentPlanes) {
  Random random(7);
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(random, random.UniformVector<3>(-2, 2));
    const Eigen::Vector3d d = random.UnitQuaternion().head<3>().normalized();
    const Eigen::Vector3d normal =
        oracle::RotationMatrix(e.orientation_xyzw) * d.cwiseQuotient(e.semi_axes);
    Eigen::Vector4d plane;
    plane << normal, -normal.dot(e.Point(d));
    const Eigen::Matrix4d Q = DualQuadricMatrix(DualQuadricFromSurface(SurfaceOf(e)));
    EXPECT_NEAR(plane.normalized().dot(Q * plane.normalized()), 0, 1e-13);
  }
}

void ExpectNoEllipsoid(const Vector9d& q) {
  try {
    EllipsoidFromDualQuadric(q);
    ADD_FAILURE() << "no exception for " << q.transpose();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("not an ellipsoid"));
  }
}

TEST(DualQuadric, ThatIsNoEllipsoidThrows) {
  ExpectNoEllipsoid((Vector9d() << 1, 0, 0, 0, 1, 0, 0, 1, 0).finished());    // Q* = I
  ExpectNoEllipsoid((Vector9d() << -1, 0, 0, 0, -1, 0, 0, 1, 0).finished());  // hyperboloid
  ExpectNoEllipsoid((Vector9d() << -1, 0, 0, 0, -1, 0, 0, 0, 0).finished());  // disc
  ExpectNoEllipsoid(Vector9d::Zero());
  ExpectNoEllipsoid(Vector9d::Constant(std::nan("")));
  ExpectNoEllipsoid(Vector9d::Constant(std::numeric_limits<double>::infinity()));
}

TEST(EllipsoidAxes, RoundTrip) {
  Random random(8);
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(random, random.UniformVector<3>(-2, 2));
    const Vector9d parameters = EllipsoidFromAxes(e.center, e.semi_axes, e.orientation_xyzw);
    const EllipsoidAxes axes = AxesFromEllipsoid(parameters);
    Eigen::Vector3d descending = e.semi_axes;
    std::sort(descending.data(), descending.data() + 3, std::greater<double>());
    EXPECT_LT((axes.semi_axes - descending).norm(), 1e-12);
    EXPECT_EQ(axes.center, e.center);
    EXPECT_NEAR(axes.orientation_xyzw.norm(), 1, 1e-14);
    const Vector9d again = EllipsoidFromAxes(axes.center, axes.semi_axes, axes.orientation_xyzw);
    EXPECT_LT((again - parameters).norm(), 1e-10);
  }
}

// Longest axis 3 along the object's x, which a quarter turn about z puts along the world's y.
TEST(EllipsoidAxes, ByHand) {
  const Vector9d e = EllipsoidFromAxes({1, 2, 3}, {3, 2, 1}, {0, 0, M_SQRT1_2, M_SQRT1_2});
  const Eigen::Matrix3d shape = EllipsoidModel::Unpack(e.data()).shape;
  EXPECT_LT((shape - Eigen::Matrix3d(Eigen::Vector3d(4, 9, 1).asDiagonal())).norm(), 1e-14);
  const EllipsoidAxes axes = AxesFromEllipsoid(e);
  EXPECT_LT((axes.semi_axes - Eigen::Vector3d(3, 2, 1)).norm(), 1e-14);
  const Eigen::Matrix3d R = oracle::RotationMatrix(axes.orientation_xyzw);
  EXPECT_NEAR(std::abs(R(1, 0)), 1, 1e-14);
  EXPECT_NEAR(R.determinant(), 1, 1e-14);
}

TEST(EllipsoidAxes, RefusesBadAxesAndQuaternions) {
  const Eigen::Vector3d c = Eigen::Vector3d::Zero(), good(1, 1, 1);
  const Eigen::Vector4d identity(0, 0, 0, 1);
  EXPECT_THROW(EllipsoidFromAxes(c, {1, 0, 1}, identity), std::invalid_argument);
  EXPECT_THROW(EllipsoidFromAxes(c, {1, -1, 1}, identity), std::invalid_argument);
  EXPECT_THROW(EllipsoidFromAxes(c, {1, std::nan(""), 1}, identity), std::invalid_argument);
  EXPECT_THROW(EllipsoidFromAxes(c, good, {0, 0, 0, 2}), std::invalid_argument);
  EXPECT_THROW(EllipsoidFromAxes(c, good, {0, 0, 0, 0}), std::invalid_argument);
  EXPECT_THROW(EllipsoidFromAxes({0, 0, std::nan("")}, good, identity), std::invalid_argument);
}

TEST(Sphere, HasItsRadiusInEveryDirection) {
  const Vector9d e = Sphere({1, 2, 3}, 0.7);
  EXPECT_LT((EllipsoidModel::Unpack(e.data()).shape - 0.49 * Eigen::Matrix3d::Identity()).norm(),
            1e-15);
  EXPECT_EQ(e.head<3>(), Eigen::Vector3d(1, 2, 3));
}

}  // namespace
}  // namespace dqslam
