#include "dqslam/ellipsoid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <limits>

#include "oracle.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 100;

Camera MakeCamera() {
  Camera camera;
  camera.fx = 700;
  camera.fy = 650;
  camera.cx = 310;
  camera.cy = 250;
  camera.width = 640;
  camera.height = 480;
  return camera;
}

oracle::Ellipsoid RandomEllipsoid(Random& random, const Eigen::Vector3d& center) {
  return {center, random.UniformVector<3>(0.1, 1.2), random.UnitQuaternion()};
}

/// In the frame of a camera at the origin.
Surface<double> SurfaceOf(const oracle::Ellipsoid& e) {
  const Vector9d parameters = EllipsoidFromAxes(e.center, e.semi_axes, e.orientation_xyzw);
  return EllipsoidModel::Unpack(parameters.data());
}

TEST(ProjectToBox, SphereOnTheAxisByHand) {
  const double r = 0.5, z = 2;
  Eigen::Vector4d box;
  ASSERT_TRUE(ProjectToBox({{0, 0, z}, r * r * Eigen::Matrix3d::Identity()}, MakeCamera(), &box));
  const double x = r / std::sqrt(z * z - r * r);
  const Eigen::Vector4d expected(310 - 700 * x, 250 - 650 * x, 310 + 700 * x, 250 + 650 * x);
  EXPECT_LT((box - expected).norm(), 1e-11);
}

TEST(ProjectToBox, AgreesWithTheSampledSurface) {
  Random random(1);
  const Camera camera = MakeCamera();
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(
        random, {random.Uniform(-3, 3), random.Uniform(-3, 3), random.Uniform(1.5, 8)});
    Eigen::Vector4d box;
    ASSERT_TRUE(ProjectToBox(SurfaceOf(e), camera, &box));
    const Eigen::Vector4d expected = oracle::Box(camera, oracle::Viewpoint(), e);
    EXPECT_LT((box - expected).norm(), 1e-7 * expected.norm()) << "trial " << trial;
  }
}

TEST(ProjectToBox, AgreesWithTheSampledSurfaceFromAnyViewpoint) {
  Random random(2);
  const Camera camera = MakeCamera();
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(random, random.UniformVector<3>(-1, 1));
    const oracle::Viewpoint view = oracle::LookAt(
        random.UniformVector<3>(4, 6), random.UniformVector<3>(-1, 1), random.Uniform(-M_PI, M_PI));
    const CameraInWorld<double> located{view.rotation.transpose(), view.position};
    Eigen::Vector4d box;
    ASSERT_TRUE(ProjectToBox(ToCamera(located, SurfaceOf(e)), camera, &box));
    EXPECT_LT((box - oracle::Box(camera, view, e)).norm(), 1e-6) << "trial " << trial;
  }
}

// C* = P Q* P^T with the 3 x 4 matrix P = K [R t]; the edges u solve C*_11 - 2 u C*_13 + u^2 C*_33.
TEST(ProjectToBox, AgreesWithTheProjectedDualQuadric) {
  Random random(3);
  const Camera camera = MakeCamera();
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(random, random.UniformVector<3>(-1, 1));
    const oracle::Viewpoint view =
        oracle::LookAt(random.UniformVector<3>(4, 6), random.UniformVector<3>(-1, 1));
    Eigen::Matrix3d K;
    K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
    Eigen::Matrix<double, 3, 4> P;
    P << view.rotation.transpose(), -view.rotation.transpose() * view.position;
    const Surface<double> surface = SurfaceOf(e);
    const Eigen::Matrix3d C =
        K * P * DualQuadricMatrix(DualQuadricFromSurface(surface)) * P.transpose() * K.transpose();
    const CameraInWorld<double> located{view.rotation.transpose(), view.position};
    Eigen::Vector4d box;
    ASSERT_TRUE(ProjectToBox(ToCamera(located, surface), camera, &box));
    for (int edge = 0; edge < 4; ++edge) {
      const int axis = edge % 2;
      const double u = box[edge];
      EXPECT_NEAR((C(axis, axis) - 2 * u * C(axis, 2) + u * u * C(2, 2)) / C(2, 2), 0, 1e-6);
    }
  }
}

TEST(TangentDistances, AreZeroForTheExactBoxAtAnyDepth) {
  Random random(4);
  const Camera camera = MakeCamera();
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(
        random, {random.Uniform(-3, 3), random.Uniform(-3, 3), random.Uniform(2, 8)});
    const Eigen::Vector4d box = oracle::Box(camera, oracle::Viewpoint(), e);
    Eigen::Vector4d distances;
    ASSERT_TRUE(TangentDistances(SurfaceOf(e), camera, box, random.Uniform(1, 9), &distances));
    EXPECT_LT(distances.norm(), 1e-6);
  }
}

// Edges of a box around a unit ball at depth 10, and depth 10 to convert: each moved inwards by
// 10 px lets the ball stick out by about as much; outwards it ends inside.
TEST(TangentDistances, ArePositiveWhereTheObjectSticksOut) {
  const Camera camera = MakeCamera();
  const Surface<double> ball{{0, 0, 10}, Eigen::Matrix3d::Identity()};
  Eigen::Vector4d box, distances;
  ASSERT_TRUE(ProjectToBox(ball, camera, &box));
  for (int edge = 0; edge < 4; ++edge) {
    for (const double inwards : {10.0, -10.0}) {
      Eigen::Vector4d moved = box;
      moved[edge] += edge < 2 ? inwards : -inwards;
      ASSERT_TRUE(TangentDistances(ball, camera, moved, 10, &distances));
      EXPECT_NEAR(distances[edge], inwards, 0.15);
      distances[edge] = 0;
      EXPECT_LT(distances.norm(), 1e-10);
    }
  }
}

// Plane x = z through the centre of the camera; ball of radius 1 at (3, 0, 1): n = (1, 0, -1),
// n.p = 2, |n| = sqrt 2.  Behind the camera, beside it and around it the same formula holds.
TEST(TangentDistances, ByHandEverywhere) {
  const Camera camera = MakeCamera();
  const Eigen::Vector4d box(310 - 700, 250 - 650, 310 + 700, 250 + 650);
  const double h = std::sqrt(2.0), depth = 7;
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(3, 0, 1),
                                   Eigen::Vector3d(0.3, 0.2, -5),
                                   Eigen::Vector3d(8, -7, 0),
                                   Eigen::Vector3d(0, 0, 0)}) {
    Eigen::Vector4d distances;
    ASSERT_TRUE(TangentDistances({p, Eigen::Matrix3d::Identity()}, camera, box, depth, &distances));
    const Eigen::Vector4d expected(100 * (-p.x() - p.z() + h),
                                   650 / depth * (-p.y() - p.z() + h),
                                   100 * (p.x() - p.z() + h),
                                   650 / depth * (p.y() - p.z() + h));
    EXPECT_LT((distances - expected).norm(), 1e-11) << p.transpose();
  }
}

TEST(TangentDistances, FailWithoutARealSurface) {
  Eigen::Vector4d distances;
  EXPECT_FALSE(TangentDistances({{0, 0, 5}, -Eigen::Matrix3d::Identity()},
                                MakeCamera(),
                                Eigen::Vector4d(300, 240, 320, 260),
                                5,
                                &distances));
}

TEST(StrictlyInFront, ByHand) {
  const auto ball_at = [](double x, double y, double z) {
    return Surface<double>{{x, y, z}, Eigen::Matrix3d::Identity()};
  };
  EXPECT_TRUE(StrictlyInFront(ball_at(0, 0, 1.001)));
  EXPECT_TRUE(StrictlyInFront(ball_at(100, 0, 1.001)));  // beside, but in front of the focal plane
  EXPECT_FALSE(StrictlyInFront(ball_at(0, 0, 0.999)));   // straddles
  EXPECT_FALSE(StrictlyInFront(ball_at(5, 0, 0.5)));     // straddles, off the axis
  EXPECT_FALSE(StrictlyInFront(ball_at(0, 0, 0)));       // around
  EXPECT_FALSE(StrictlyInFront(ball_at(5, 0, 0)));       // beside
  EXPECT_FALSE(StrictlyInFront(ball_at(0, 0, -0.5)));
  EXPECT_FALSE(StrictlyInFront(ball_at(0, 0, -10)));  // behind
  EXPECT_FALSE(StrictlyInFront(ball_at(0, 0, std::nan(""))));
}

TEST(StrictlyInFront, IsPositiveDepthOfEverySurfacePoint) {
  Random random(5);
  int in_front = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(random, random.UniformVector<3>(-1.5, 1.5));
    const double nearest = oracle::NearestDepth(oracle::Viewpoint(), e);
    EXPECT_EQ(StrictlyInFront(SurfaceOf(e)), nearest > 0) << nearest;
    in_front += nearest > 0;
  }
  EXPECT_GT(in_front, 10);
  EXPECT_LT(in_front, 90);
}

// The formula would give a finite, wrong box there.
TEST(ProjectToBox, FailsUnlessStrictlyInFront) {
  Eigen::Vector4d box;
  for (const double z : {-5.0, -0.5, 0.0, 0.5, 1.0}) {
    EXPECT_FALSE(ProjectToBox({{0.1, 0, z}, Eigen::Matrix3d::Identity()}, MakeCamera(), &box));
  }
}

TEST(ProjectToBox, FailsForAQuadricWithoutAnOutline) {
  Eigen::Vector4d box;
  EXPECT_FALSE(ProjectToBox({{0, 0, 5}, -Eigen::Matrix3d::Identity()}, MakeCamera(), &box));
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
