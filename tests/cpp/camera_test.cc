#include "dqslam/geometry/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "cameras.h"
#include "oracle.h"
#include "random.h"

namespace dqslam {
namespace {

using testing::HasSubstr;

Camera DistortedCamera() {
  Camera camera = MakeCamera();
  camera.distortion << -0.3, 0.1, 0.001, -0.002, 0.01;
  return camera;
}

RowMatrix Row(std::initializer_list<double> values) {
  RowMatrix row(1, values.size());
  std::copy(values.begin(), values.end(), row.data());
  return row;
}

// x = 0.5, y = 0.25, r^2 = 0.3125: one coefficient at a time, as OpenCV documents them.
TEST(DistortPoints, EachCoefficientByHand) {
  const double x = 0.5, y = 0.25, r2 = 0.3125;
  const Eigen::Vector2d expected[5] = {
      {x * (1 + 0.1 * r2), y * (1 + 0.1 * r2)},
      {x * (1 + 0.1 * r2 * r2), y * (1 + 0.1 * r2 * r2)},
      {x + 0.1 * 2 * x * y, y + 0.1 * (r2 + 2 * y * y)},
      {x + 0.1 * (r2 + 2 * x * x), y + 0.1 * 2 * x * y},
      {x * (1 + 0.1 * r2 * r2 * r2), y * (1 + 0.1 * r2 * r2 * r2)},
  };
  for (int k = 0; k < 5; ++k) {
    Camera camera = MakeCamera();
    camera.distortion[k] = 0.1;
    const RowMatrix distorted = camera.DistortPoints(Row({500 * x + 320, 400 * y + 240}));
    EXPECT_NEAR(distorted(0, 0), 500 * expected[k].x() + 320, 1e-12) << "coefficient " << k;
    EXPECT_NEAR(distorted(0, 1), 400 * expected[k].y() + 240, 1e-12) << "coefficient " << k;
  }
}

TEST(DistortPoints, LeavesThePrincipalPoint) {
  EXPECT_EQ(DistortedCamera().DistortPoints(Row({320, 240})), Row({320, 240}));
}

TEST(UndistortPoints, InvertsDistortPointsOverTheImage) {
  const Camera camera = DistortedCamera();
  RowMatrix points(25, 2);
  for (int i = 0; i < 25; ++i) points.row(i) << 160 * (i % 5), 120 * (i / 5);
  EXPECT_LT((camera.DistortPoints(camera.UndistortPoints(points)) - points).cwiseAbs().maxCoeff(),
            1e-8);
}

TEST(UndistortPoints, ThrowsBehindTheFoldOfTheDistortion) {
  Camera camera = MakeCamera();
  camera.distortion[0] = -0.3;  // r (1 - 0.3 r^2) is at most 0.70
  RowMatrix points(2, 2);
  points << 320, 240, 320 + 500 * 0.9, 240;
  try {
    camera.UndistortPoints(points);
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("points row 1"));
  }
}

TEST(UndistortBoxes, MovesEachEdgeAtItsMiddle) {
  const Camera camera = DistortedCamera();
  const RowMatrix boxes = camera.UndistortBoxes(Row({100, 80, 300, 400}));
  EXPECT_DOUBLE_EQ(boxes(0, 0), camera.UndistortPoints(Row({100, 240}))(0, 0));
  EXPECT_DOUBLE_EQ(boxes(0, 1), camera.UndistortPoints(Row({200, 80}))(0, 1));
  EXPECT_DOUBLE_EQ(boxes(0, 2), camera.UndistortPoints(Row({300, 240}))(0, 0));
  EXPECT_DOUBLE_EQ(boxes(0, 3), camera.UndistortPoints(Row({200, 400}))(0, 1));
  EXPECT_LT(boxes(0, 0), 100);  // barrel distortion had pulled it in
}

TEST(UndistortBoxes, IsExactlyTheIdentityWithoutDistortion) {
  const RowMatrix box = Row({100.1, 80.2, 300.3, 400.4});
  EXPECT_EQ(MakeCamera().UndistortBoxes(box), box);
}

TEST(UndistortBoxes, NamesTheBoxBehindTheFoldOfTheDistortion) {
  Camera camera = MakeCamera();
  camera.distortion[0] = -0.3;
  RowMatrix boxes(2, 4);
  boxes << 300, 200, 340, 280, 300, 200, 320 + 500 * 0.9, 280;
  try {
    camera.UndistortBoxes(boxes);
    FAIL() << "no exception";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("boxes row 1: the distortion cannot be inverted"));
  }
}

TEST(DistortBoxes, InvertsUndistortBoxes) {
  const Camera camera = DistortedCamera();
  RowMatrix boxes(3, 4);
  boxes << 10, 20, 100, 220, 300, 200, 420, 470, -0.5, 5, 639.5, 90;
  const RowMatrix undistorted = camera.UndistortBoxes(boxes);
  EXPECT_GT((undistorted - boxes).cwiseAbs().maxCoeff(), 10);
  EXPECT_LT((camera.DistortBoxes(undistorted) - boxes).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_EQ(MakeCamera().DistortBoxes(boxes), boxes);
}

TEST(LocateCamera, MountByHand) {
  Camera camera = MakeCamera();  // half a meter ahead, turned left by 90 degrees on a robot ...
  camera.robot_from_camera << 0.5, 0, 0.2, 0, 0, std::sqrt(0.5), std::sqrt(0.5);
  const double pose[3] = {1, 2, M_PI / 2};  // ... that looks north from (1, 2)
  const CameraInWorld<double> located = LocateCamera<Se2>(pose, Mount(camera));
  EXPECT_LT((located.position - Eigen::Vector3d(1, 2.5, 0.2)).norm(), 1e-15);
  const Eigen::Vector3d camera_x_in_world = located.camera_from_world.row(0);
  EXPECT_LT((camera_x_in_world - Eigen::Vector3d(-1, 0, 0)).norm(), 1e-15);  // west
}

TEST(LocateCamera, IsThePoseTimesTheMount) {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    Camera camera = MakeCamera();
    camera.robot_from_camera = random.RandomPose<Se3>();
    const Eigen::Matrix<double, 7, 1> pose = random.RandomPose<Se3>();
    const CameraInWorld<double> located = LocateCamera<Se3>(pose.data(), Mount(camera));
    const Eigen::Matrix3d world_from_robot = oracle::RotationMatrix(pose.tail<4>());
    const Eigen::Matrix3d robot_from_camera =
        oracle::RotationMatrix(camera.robot_from_camera.tail<4>());
    EXPECT_TRUE(located.camera_from_world.transpose().isApprox(world_from_robot * robot_from_camera,
                                                               1e-13));
    EXPECT_TRUE(located.position.isApprox(
        world_from_robot * camera.robot_from_camera.head<3>() + pose.head<3>(), 1e-13));
  }
}

struct BadCamera {
  const char* message;
  void (*spoil)(Camera&);
};

TEST(Camera, ValidateSaysWhatIsWrong) {
  const BadCamera cases[] = {
      {"fx and fy must be positive", [](Camera& c) { c.fx = 0; }},
      {"fx and fy must be positive", [](Camera& c) { c.fy = -1; }},
      {"must be finite", [](Camera& c) { c.cx = std::nan(""); }},
      {"must be finite", [](Camera& c) { c.fx = std::numeric_limits<double>::infinity(); }},
      {"must be finite", [](Camera& c) { c.distortion[4] = std::nan(""); }},
      {"must be finite", [](Camera& c) { c.robot_from_camera[0] = std::nan(""); }},
      {"width and height must be positive", [](Camera& c) { c.width = 0; }},
      {"width and height must be positive", [](Camera& c) { c.height = -480; }},
      {"unit quaternion", [](Camera& c) { c.robot_from_camera[6] = 0.9; }},
      {"unit quaternion", [](Camera& c) { c.robot_from_camera.setZero(); }},
  };
  EXPECT_NO_THROW(DistortedCamera().Validate());
  for (const BadCamera& bad : cases) {
    Camera camera = DistortedCamera();
    bad.spoil(camera);
    try {
      camera.Validate();
      ADD_FAILURE() << "no exception: " << bad.message;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(bad.message));
    }
  }
}

}  // namespace
}  // namespace dqslam
