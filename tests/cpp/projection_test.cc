// Projection, tangent distances and visibility of ellipsoid.h.
#include <gtest/gtest.h>

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/outline.h"
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

// Plane x = z through the center of the camera; ball of radius 1 at (3, 0, 1): n = (1, 0, -1),
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

TEST(TangentDepth, IsThatOfTheCenterButNeverLessThanTheObjectIsThick) {
  const Eigen::Matrix3d shape = Eigen::Vector3d(1, 1, 0.04).asDiagonal();
  EXPECT_DOUBLE_EQ(TangentDepth({{1, 2, 5}, shape}), 5);
  EXPECT_DOUBLE_EQ(TangentDepth({{1, 2, 0.1}, shape}), 0.3);
  EXPECT_DOUBLE_EQ(TangentDepth({{1, 2, -3}, shape}), 0.3);
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

TEST(TouchingPoints, AgreeWithTheSampledSurface) {
  Random random(9);
  const Camera camera = MakeCamera();
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(
        random, {random.Uniform(-3, 3), random.Uniform(-3, 3), random.Uniform(2, 8)});
    const Surface<double> surface = SurfaceOf(e);
    Eigen::Vector4d box;
    ASSERT_TRUE(ProjectToBox(surface, camera, &box));
    const Eigen::Matrix<double, 4, 2> expected =
        oracle::ExtremePixels(camera, oracle::Viewpoint(), e);
    EXPECT_LT((TouchingPoints(surface, camera, box) - expected).norm(), 1e-3);  // flat there
  }
}

// A sphere that the image's right border (u = 640) cuts: its outline ends at u = 763.
TEST(OneSidedEdges, AreThoseCutAndThoseTouchedOutsideTheImage) {
  const Camera camera = MakeCamera();
  const Surface<double> sphere{{0.7, 0, 2}, 0.25 * Eigen::Matrix3d::Identity()};
  Eigen::Vector4d box;
  ASSERT_TRUE(ProjectToBox(sphere, camera, &box));
  EXPECT_NEAR(box[2], 763, 1);
  const EdgeFlags none = EdgeFlags::Constant(false);
  EXPECT_FALSE(OneSidedEdges(none, camera, sphere, box).any());
  EdgeFlags top = none, top_and_right = none;
  top[1] = top_and_right[1] = top_and_right[2] = true;
  EXPECT_TRUE((OneSidedEdges(top, camera, sphere, box) == top_and_right).all());
}

TEST(IgnoreBeyond, KeepsOnlyWhatEndsInside) {
  const EdgeFlags all = EdgeFlags::Constant(true), none = EdgeFlags::Constant(false);
  const Eigen::Vector4d beyond(-3, -2, 3, 2), inside(3, 2, -3, -2);  // predicted - observed
  Eigen::Vector4d error = beyond;
  IgnoreBeyond(all, &error);
  EXPECT_TRUE(error.isZero(0));
  error = inside;
  IgnoreBeyond(all, &error);
  EXPECT_EQ(error, inside);
  error = beyond;
  IgnoreBeyond(none, &error);
  EXPECT_EQ(error, beyond);
}

}  // namespace
}  // namespace dqslam
