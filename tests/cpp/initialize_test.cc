#include "dqslam/estimation/initialize.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oracle.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 10;
constexpr double kSide = 5;  // meters from the camera to the object

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

oracle::Ellipsoid RandomEllipsoid(Random& random) {
  return {random.UniformVector<3>(-0.5, 0.5),
          random.UniformVector<3>(0.2, 0.7),
          random.UnitQuaternion()};
}

View Look(const oracle::Viewpoint& from, const oracle::Ellipsoid& ellipsoid) {
  View view;
  view.camera = {from.rotation.transpose(), from.position};
  view.box = oracle::Box(MakeCamera(), from, ellipsoid);
  view.sqrt_information = Eigen::Matrix4d::Identity() / 2;
  return view;
}

/// Level camera at (x, y, 0) that looks along the angle `azimuth` [rad].
oracle::Viewpoint Level(double x, double y, double azimuth) {
  const Eigen::Vector3d position(x, y, 0);
  return oracle::LookAt(position,
                        position + Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0));
}

/// From all sides, with any roll.
std::vector<View> GeneralMotion(Random& random, const oracle::Ellipsoid& ellipsoid, int count) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d direction = random.UnitQuaternion().head<3>().normalized();
    views.push_back(Look(oracle::LookAt(random.Uniform(4, 7) * direction,
                                        random.UniformVector<3>(-0.5, 0.5),
                                        random.Uniform(-M_PI, M_PI)),
                         ellipsoid));
  }
  return views;
}

/// Drives along x with a constant heading; the level camera looks along +y.
std::vector<View> ConstantHeading(const oracle::Ellipsoid& ellipsoid, int count) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    views.push_back(Look(Level(-2 + 4.0 * i / (count - 1), -kSide, M_PI / 2), ellipsoid));
  }
  return views;
}

/// Drives a circle around the origin; the level camera looks at its center.
std::vector<View> Circle(const oracle::Ellipsoid& ellipsoid, double arc, int count) {
  std::vector<View> views;
  for (int i = 0; i < count; ++i) {
    const double angle = arc * i / count;
    views.push_back(
        Look(Level(kSide * std::cos(angle), kSide * std::sin(angle), angle + M_PI), ellipsoid));
  }
  return views;
}

Vector9d QuadricOf(const oracle::Ellipsoid& e) {
  return DualQuadricFromEllipsoid(EllipsoidFromAxes(e.center, e.semi_axes, e.orientation_xyzw));
}

TEST(FitSvd, IsExactOnGeneralMotion) {
  Random random(1);
  for (const int count : {3, 6, 20}) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const oracle::Ellipsoid e = RandomEllipsoid(random);
      const SvdFit fit = FitSvd(MakeCamera(), GeneralMotion(random, e, count));
      EXPECT_LT((fit.quadric - QuadricOf(e)).norm(), 1e-8) << count << " views";
      EXPECT_FALSE(fit.degenerate) << fit.singular_values.transpose();
      EXPECT_LT(fit.singular_values[9], 1e-10 * fit.singular_values[0]);
      EXPECT_GT(fit.singular_values[8], 1e-4 * fit.singular_values[0]);
    }
  }
}

// Far from the origin the planes' offsets dwarf their normals: hence the centering.
TEST(FitSvd, IsExactFarFromTheOrigin) {
  Random random(2);
  const Eigen::Vector3d offset(1000, -2000, 50);
  for (int trial = 0; trial < kTrials; ++trial) {
    oracle::Ellipsoid e = RandomEllipsoid(random);
    std::vector<View> views = GeneralMotion(random, e, 10);
    for (View& view : views) view.camera.position += offset;
    e.center += offset;
    const SvdFit fit = FitSvd(MakeCamera(), views);
    const Surface<double> found = DualQuadricModel::Unpack(fit.quadric.data());
    EXPECT_LT((found.center - e.center).norm(), 1e-8);
    const Vector9d truth = QuadricOf(e);
    EXPECT_LT((found.shape - DualQuadricModel::Unpack(truth.data()).shape).norm(), 1e-7);
  }
}

TEST(FitSvd, IsExactOnATurningPlanarCircle) {
  Random random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const oracle::Ellipsoid e = RandomEllipsoid(random);
    const SvdFit fit = FitSvd(MakeCamera(), Circle(e, 2 * M_PI, 16));
    EXPECT_FALSE(fit.degenerate) << fit.singular_values.transpose();
    EXPECT_LT((fit.quadric - QuadricOf(e)).norm(), 1e-7);
  }
}

// No plane has a normal with both an x and a z component: that tilt of the object is free, also
// with noise.
TEST(FitSvd, ConstantHeadingIsFlaggedAndVisibleInTheSingularValues) {
  Random random(4);
  for (const double sigma : {0.0, 1.0, 5.0}) {
    for (int trial = 0; trial < kTrials; ++trial) {
      std::vector<View> views = ConstantHeading(RandomEllipsoid(random), 12);
      for (View& view : views) {
        for (double& edge : view.box) edge += sigma * random.Normal();
      }
      const SvdFit fit = FitSvd(MakeCamera(), views);
      EXPECT_TRUE(fit.degenerate) << fit.singular_values.transpose();
      EXPECT_LT(fit.singular_values[8], 1e-12 * fit.singular_values[0]);
      EXPECT_LT(fit.singular_values[9], 1e-12 * fit.singular_values[0]);
    }
  }
}

// The smaller the arc, the weaker the second smallest singular value, without a threshold.
TEST(FitSvd, AShorterArcShowsInTheSingularValues) {
  Random random(5);
  const oracle::Ellipsoid e = RandomEllipsoid(random);
  double previous = 0;
  for (const double arc : {0.01, 0.1, 0.5, 2.0}) {
    const SvdFit fit = FitSvd(MakeCamera(), Circle(e, arc, 12));
    const double relative = fit.singular_values[8] / fit.singular_values[0];
    EXPECT_GT(relative, 2 * previous) << "arc " << arc;
    previous = relative;
  }
}

// A robot that stands still, or only turns, has seen no depth; at the origin and elsewhere.
TEST(FitSvd, WithoutMotionIsFlaggedAndFinite) {
  Random random(6);
  for (const double x : {0.0, 3.0}) {
    for (const double turn : {0.0, 0.02}) {
      const oracle::Ellipsoid e{{x, 4, 0}, {0.5, 0.4, 0.3}, random.UnitQuaternion()};
      std::vector<View> views;
      for (int i = 0; i < 5; ++i) views.push_back(Look(Level(x, 0, M_PI / 2 + turn * i), e));
      const SvdFit fit = FitSvd(MakeCamera(), views);
      EXPECT_TRUE(fit.degenerate) << "at " << x << ", turning by " << turn;
      EXPECT_LT(fit.singular_values[8], 1e-12 * fit.singular_values[0]);
      EXPECT_TRUE(fit.singular_values.allFinite()) << fit.singular_values.transpose();
      EXPECT_TRUE(fit.quadric.allFinite()) << fit.quadric.transpose();
    }
  }
}

TEST(FitSvd, FewerThanThreeViewsThrow) {
  Random random(7);
  const oracle::Ellipsoid e = RandomEllipsoid(random);
  try {
    FitSvd(MakeCamera(), GeneralMotion(random, e, 2));
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("needs 3 views of an object, it has 2"));
  }
}

// Edges that the border cut may say anything.
TEST(FitSvd, IgnoresTruncatedEdges) {
  Random random(9);
  const oracle::Ellipsoid e = RandomEllipsoid(random);
  std::vector<View> views = GeneralMotion(random, e, 12);
  for (size_t i = 0; i < views.size(); i += 2) {
    views[i].truncated[i % 4] = true;
    views[i].box[i % 4] = 320;
  }
  EXPECT_LT((FitSvd(MakeCamera(), views).quadric - QuadricOf(e)).norm(), 1e-8);
}

TEST(IdentityQuadric, IsTheIdentityMatrix) {
  EXPECT_EQ(DualQuadricMatrix(IdentityQuadric()), Eigen::Matrix4d(Eigen::Matrix4d::Identity()));
}

// Box of 70 x 65 px is 0.1 x 0.1 in normalized coordinates: a radius of 0.5 m fits at 10 m.
TEST(BackProject, DepthByHand) {
  View view;
  view.camera = {Eigen::Matrix3d::Identity(), {1, 2, 3}};
  view.box << 310 + 70 - 35, 250 - 32.5, 310 + 70 + 35, 250 + 32.5;
  view.sqrt_information.setIdentity();
  const Vector9d sphere = BackProject(MakeCamera(), {view}, {std::log(0.5), 0.6});
  EXPECT_LT((sphere - Sphere({1 + 1, 2, 3 + 10}, 0.5)).norm(), 1e-12);
}

TEST(BackProject, IsTheMeanOfItsViews) {
  View left, right;
  for (View* view : {&left, &right}) {
    view->camera = {Eigen::Matrix3d::Identity(), {view == &left ? -1.0 : 3.0, 0, 0}};
    view->box << 310 - 35, 250 - 32.5, 310 + 35, 250 + 32.5;
    view->sqrt_information.setIdentity();
  }
  const Vector9d sphere = BackProject(MakeCamera(), {left, right}, {std::log(0.5), 0.6});
  EXPECT_LT((sphere - Sphere({1, 0, 10}, 0.5)).norm(), 1e-12);
}

// As in the first test, but the border left only half of the width.
TEST(BackProject, TrustsTheSideThatTheBorderLeft) {
  View view;
  view.camera = {Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()};
  view.box << 310, 250 - 32.5, 310 + 35, 250 + 32.5;
  view.sqrt_information.setIdentity();
  view.truncated[0] = true;
  const Vector9d sphere = BackProject(MakeCamera(), {view}, {std::log(0.5), 0.6});
  EXPECT_NEAR(sphere[2], 10, 1e-12);
}

// A box as wide as the image would put the camera into the sphere.
TEST(BackProject, StaysInFrontOfTheCamera) {
  View view;
  view.camera = {Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()};
  view.box << 310 - 7000, 250 - 6500, 310 + 7000, 250 + 6500;
  view.sqrt_information.setIdentity();
  const Vector9d sphere = BackProject(MakeCamera(), {view}, {0, 0.6});
  EXPECT_TRUE(StrictlyInFront(EllipsoidModel::Unpack(sphere.data())));
  EXPECT_NEAR(sphere[2], 1.5, 1e-12);
}

TEST(FitSphere, IsExactForASphere) {
  Random random(8);
  for (int trial = 0; trial < kTrials; ++trial) {
    const double radius = random.Uniform(0.2, 0.7);
    const oracle::Ellipsoid ball{random.UniformVector<3>(-0.5, 0.5),
                                 Eigen::Vector3d::Constant(radius),
                                 random.UnitQuaternion()};
    const Vector9d expected = Sphere(ball.center, radius);
    const SizePrior broad{std::log(0.4), 1e6};
    const Vector9d general = FitSphere(MakeCamera(), GeneralMotion(random, ball, 8), broad);
    EXPECT_LT((general - expected).norm(), 1e-8);
    const Vector9d straight = FitSphere(MakeCamera(), ConstantHeading(ball, 8), broad);
    EXPECT_LT((straight - expected).norm(), 1e-7);
  }
}

TEST(FitSphere, IgnoresTruncatedEdges) {
  Random random(10);
  const oracle::Ellipsoid ball{{0.1, 0.2, -0.1}, Eigen::Vector3d::Constant(0.5), {0, 0, 0, 1}};
  std::vector<View> views = GeneralMotion(random, ball, 8);
  for (size_t i = 0; i < views.size(); i += 2) {
    views[i].truncated[i % 4] = true;
    views[i].box[i % 4] += i % 4 < 2 ? 5 : -5;
  }
  const Vector9d sphere = FitSphere(MakeCamera(), views, {std::log(0.4), 1e6});
  EXPECT_LT((sphere - Sphere(ball.center, 0.5)).norm(), 1e-7);
}

// An honest prior of 0.6 pulls the radius of a ball at twice the expected size by little.
TEST(FitSphere, ABroadPriorHardlyPulls) {
  const oracle::Ellipsoid ball{{0.1, 0.2, -0.1}, Eigen::Vector3d::Constant(0.8), {0, 0, 0, 1}};
  const Vector9d sphere = FitSphere(MakeCamera(), ConstantHeading(ball, 8), {std::log(0.4), 0.6});
  EXPECT_LT((sphere - Sphere(ball.center, 0.8)).norm(), 0.01);
}

// One view fixes the direction; the prior fixes the size and so the depth.
TEST(FitSphere, TakesTheSizeFromThePriorWhereOneViewIsAll) {
  const oracle::Ellipsoid ball{{0.3, 0, 0}, Eigen::Vector3d::Constant(0.5), {0, 0, 0, 1}};
  const std::vector<View> views = {Look(Level(0, -kSide, M_PI / 2), ball)};
  const Vector9d sphere = FitSphere(MakeCamera(), views, {std::log(0.5), 0.6});
  EXPECT_LT((sphere - Sphere(ball.center, 0.5)).norm(), 1e-6);
}

// Boxes that no sphere in front of both cameras explains: the object would be behind them.
TEST(FitSphere, FallsBackToBackProjectionWhereRaysDiverge) {
  std::vector<View> views(2);
  for (int i = 0; i < 2; ++i) {
    const double side = i == 0 ? -1 : 1;
    views[i].camera = {Eigen::Matrix3d::Identity(), {side, 0, 0}};
    views[i].box << 310 + side * 200 - 35, 250 - 32.5, 310 + side * 200 + 35, 250 + 32.5;
    views[i].sqrt_information.setIdentity();
  }
  const SizePrior prior{std::log(0.5), 100};
  EXPECT_EQ(FitSphere(MakeCamera(), views, prior), BackProject(MakeCamera(), views, prior));
}

}  // namespace
}  // namespace dqslam
