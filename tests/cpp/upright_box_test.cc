#include "dqslam/tracks/upright_box.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <functional>

#include "cameras.h"
#include "random.h"

namespace dqslam::tracks {
namespace {

const Eigen::Vector3d kHalf(2, 0.9, 0.75);

// The camera looks along x of a frame whose third axis is up.
Eigen::Matrix3d Ahead() {
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return rotation;
}

// Foot 10 m ahead, 1 m below: the near face, at 8 m, has the outermost corners.  The far ones, 8 px
// further inward, have shares of 1e-7.
TEST(UprightBox, StraightAheadByHand) {
  const View view{Ahead(), Eigen::Vector3d::Zero()};
  const UprightBox seen = PredictBox(MakeCamera(), view, {{10, 0, -1}, 0, kHalf});
  EXPECT_TRUE(seen.in_front && seen.is_whole);
  // y is down: the foot at 1 m, the roof at -0.5 m.
  EXPECT_NEAR(seen.box[0], 320 - 500 * 0.9 / 8, 1e-5);
  EXPECT_NEAR(seen.box[1], 240 - 400 * 0.5 / 8, 1e-5);
  EXPECT_NEAR(seen.box[2], 320 + 500 * 0.9 / 8, 1e-5);
  EXPECT_NEAR(seen.box[3], 240 + 400 * 1.0 / 8, 1e-5);
  // 1 m farther left moves both sides by f / 8, 1 m higher both ends up.
  EXPECT_NEAR(seen.by_place(0, 1), -500.0 / 8, 1e-3);
  EXPECT_NEAR(seen.by_place(2, 1), -500.0 / 8, 1e-3);
  EXPECT_NEAR(seen.by_place(1, 2), -400.0 / 8, 1e-3);
  EXPECT_NEAR(seen.by_place(3, 2), -400.0 / 8, 1e-3);
}

// A derivative beside the central difference of the box.
void ExpectColumn(const Eigen::Vector4d& column,
                  const std::function<UprightBox(double)>& moved,
                  const char* name) {
  constexpr double kStep = 1e-6;
  const Eigen::Vector4d difference = (moved(kStep).box - moved(-kStep).box) / (2 * kStep);
  EXPECT_LT((column - difference).cwiseAbs().maxCoeff(), 1e-5) << name;
}

TEST(UprightBox, DerivativesAreSmallDifferences) {
  Random random(1);
  const Camera camera = MakeCamera();
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d tilt = random.UniformVector<3>(-0.3, 0.3);
    const View view{Ahead() * Eigen::AngleAxisd(tilt.norm(), tilt.normalized()),
                    random.UniformVector<3>(-1, 1)};
    const UprightCuboid body{Eigen::Vector3d(12, 0, -1.5) + random.UniformVector<3>(-1, 1),
                             random.Uniform(-3, 3),
                             kHalf};
    const UprightBox seen = PredictBox(camera, view, body);
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
      const auto at_foot = [&](double step) {
        return PredictBox(camera, view, {body.foot + step * unit, body.heading, kHalf});
      };
      const auto of_size = [&](double step) {
        const Eigen::Vector3d half = kHalf.array() * (step * unit).array().exp();
        return PredictBox(camera, view, {body.foot, body.heading, half});
      };
      const auto shifted = [&](double step) {
        const Eigen::Vector3d position = view.position + view.rotation * unit * step;
        return PredictBox(camera, {view.rotation, position}, body);
      };
      const auto turned = [&](double step) {
        const Eigen::Matrix3d rotation = view.rotation * Eigen::AngleAxisd(step, unit);
        return PredictBox(camera, {rotation, view.position}, body);
      };
      ExpectColumn(seen.by_place.col(axis), at_foot, "foot");
      ExpectColumn(seen.by_size.col(axis), of_size, "size");
      ExpectColumn(seen.by_camera.col(axis), shifted, "shift of the camera");
      ExpectColumn(seen.by_camera.col(3 + axis), turned, "turn of the camera");
    }
    const auto headed = [&](double step) {
      return PredictBox(camera, view, {body.foot, body.heading + step, kHalf});
    };
    ExpectColumn(seen.by_place.col(3), headed, "heading");
  }
}

// The cuboid reaches from 2 m behind its middle to 2 m before it.
TEST(UprightBox, SaysWhatIsBesideOrBehindTheCamera) {
  const View view{Ahead(), Eigen::Vector3d::Zero()};
  const UprightBox behind = PredictBox(MakeCamera(), view, {{-5, 0, -1}, 0, kHalf});
  EXPECT_FALSE(behind.in_front);
  EXPECT_TRUE(behind.box.array().isNaN().all());
  const UprightBox beside = PredictBox(MakeCamera(), view, {{1, 0, -1}, 0, kHalf});
  EXPECT_TRUE(beside.in_front);
  EXPECT_FALSE(beside.is_whole);
  EXPECT_TRUE(beside.box.allFinite());
}

}  // namespace
}  // namespace dqslam::tracks
