// One test for each line of the conventions in blocks.h.
#include <gtest/gtest.h>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/ellipsoid.h"
#include "oracle.h"

namespace dqslam {
namespace {

constexpr double kSqrtHalf = M_SQRT1_2;

Camera MakeCamera(const Eigen::Vector4d& robot_from_camera_xyzw) {
  Camera camera;
  camera.fx = camera.fy = 400;
  camera.width = 640;
  camera.height = 480;
  camera.cx = 0.5 * (camera.width - 1);
  camera.cy = 0.5 * (camera.height - 1);
  camera.robot_from_camera << 0, 0, 0, robot_from_camera_xyzw;
  return camera;
}

// Optical axis along the robot's y: x_camera = x_robot, y_camera = -z_robot, z_camera = y_robot.
Camera CameraLookingLeft() {
  return MakeCamera({-kSqrtHalf, 0, 0, kSqrtHalf});
}

// x_camera = -y_robot, y_camera = -z_robot, z_camera = x_robot.
Camera CameraLookingForward() {
  return MakeCamera({-0.5, 0.5, -0.5, 0.5});
}

/// Middle of the box of a small ball in the world, seen from an SE(2) pose [px].
Eigen::Vector2d PixelOf(const Eigen::Vector3d& point,
                        const Eigen::Vector3d& pose,
                        const Camera& camera) {
  const Vector9d ball = Sphere(point, 1e-4);
  Eigen::Vector4d box;
  const CameraInWorld<double> located = LocateCamera<Se2>(pose.data(), Mount(camera));
  EXPECT_TRUE(ProjectToBox(ToCamera(located, EllipsoidModel::Unpack(ball.data())), camera, &box));
  return 0.5 * (box.head<2>() + box.tail<2>());
}

// a_from_c = a_from_b o b_from_c takes a point in c over b to a.
TEST(Conventions, TransformsAreTargetFromSource) {
  const double world_from_robot[3] = {10, 0, M_PI / 2}, robot_from_object[3] = {2, 1, 0};
  double world_from_object[3];
  Se2::Compose(world_from_robot, robot_from_object, world_from_object);
  // Two ahead and one to the left of a robot at (10, 0) that looks along +y.
  EXPECT_NEAR(world_from_object[0], 9, 1e-14);
  EXPECT_NEAR(world_from_object[1], 2, 1e-14);
}

TEST(Conventions, CameraIsXRightYDownZForward) {
  const Camera camera = CameraLookingForward();
  const Eigen::Vector3d pose(0, 0, 0);
  const Eigen::Vector2d center = PixelOf({5, 0, 0}, pose, camera);
  EXPECT_LT((center - Eigen::Vector2d(camera.cx, camera.cy)).norm(), 1e-6);
  EXPECT_NEAR(PixelOf({5, -1, 0}, pose, camera).x(), camera.cx + 80, 1e-4);  // to the robot's right
  EXPECT_NEAR(PixelOf({5, 0, 1}, pose, camera).y(), camera.cy - 80, 1e-4);   // above
}

TEST(Conventions, RobotIsXForwardYLeftZUp) {
  const Camera camera = CameraLookingLeft();
  const Eigen::Vector3d pose(1, 2, M_PI / 2);  // at (1, 2), driving along +y: left is -x
  const Eigen::Vector2d center = PixelOf({-4, 2, 0}, pose, camera);
  EXPECT_LT((center - Eigen::Vector2d(camera.cx, camera.cy)).norm(), 1e-6);
  EXPECT_NEAR(PixelOf({-4, 3, 0}, pose, camera).x(), camera.cx + 80, 1e-4);  // further ahead
  EXPECT_NEAR(PixelOf({-4, 2, 1}, pose, camera).y(), camera.cy - 80, 1e-4);  // higher
}

TEST(Conventions, Se2PoseIsXYTheta) {
  const double pose[3] = {1, 2, M_PI / 6};
  const Rigid<double> world_from_robot = Se2::WorldFromRobot(pose);
  EXPECT_EQ(world_from_robot.translation, Eigen::Vector3d(1, 2, 0));
  const Eigen::Vector3d forward = world_from_robot.rotation.col(0);
  EXPECT_LT((forward - Eigen::Vector3d(std::sqrt(0.75), 0.5, 0)).norm(), 1e-15);
  EXPECT_EQ(world_from_robot.rotation.col(2), Eigen::Vector3d::UnitZ());
}

TEST(Conventions, Se3PoseIsTranslationThenQuaternionXyzw) {
  const double pose[7] = {1, 2, 3, 0, 0, kSqrtHalf, kSqrtHalf};  // a quarter turn about z
  const Rigid<double> world_from_robot = Se3::WorldFromRobot(pose);
  EXPECT_EQ(world_from_robot.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_LT((world_from_robot.rotation.col(0) - Eigen::Vector3d::UnitY()).norm(), 1e-15);
  EXPECT_LT((world_from_robot.rotation.col(2) - Eigen::Vector3d::UnitZ()).norm(), 1e-15);
}

TEST(Conventions, Se2TangentIsTranslationThenAngleInTheFrameOfThePose) {
  const double pose[3] = {1, 2, M_PI / 2}, tangent[3] = {0.5, 0.25, 0.1};
  double result[3];
  Plus<Se2>(pose, tangent, result);
  EXPECT_NEAR(result[0], 1 - 0.25, 1e-15);
  EXPECT_NEAR(result[1], 2 + 0.5, 1e-15);
  EXPECT_NEAR(result[2], M_PI / 2 + 0.1, 1e-15);
}

// The translation is not turned by the rotation of the same tangent.
TEST(Conventions, Se3TangentIsTranslationThenRotationInTheFrameOfThePose) {
  const double pose[7] = {1, 2, 3, 0, 0, kSqrtHalf, kSqrtHalf};
  const double tangent[6] = {0.5, 0, 0, M_PI / 2, 0, 0};  // ahead, and about the robot's own x
  double result[7];
  Plus<Se3>(pose, tangent, result);
  const Rigid<double> world_from_robot = Se3::WorldFromRobot(result);
  EXPECT_LT((world_from_robot.translation - Eigen::Vector3d(1, 2.5, 3)).norm(), 1e-15);
  Eigen::Matrix3d expected;  // columns: robot x stays world y; robot y points up; robot z to x
  expected << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  EXPECT_LT((world_from_robot.rotation - expected).norm(), 1e-15);
}

TEST(Conventions, EllipsoidIsCenterThenLogCholesky) {
  const double e[9] = {1, 2, 3, std::log(2.0), std::log(3.0), std::log(4.0), 0.1, 0.2, 0.3};
  Eigen::Matrix3d L;
  L << 2, 0, 0, 0.1, 3, 0, 0.2, 0.3, 4;
  const Surface<double> surface = EllipsoidModel::Unpack(e);
  EXPECT_EQ(surface.center, Eigen::Vector3d(1, 2, 3));
  EXPECT_LT((surface.shape - L * L.transpose()).norm(), 1e-14);
}

TEST(Conventions, QuadricIsTheUpperTriangleRowByRow) {
  const Vector9d q = (Vector9d() << 1, 2, 3, 4, 5, 6, 7, 8, 9).finished();
  Eigen::Matrix4d expected;
  expected << 1, 2, 3, 4, 2, 5, 6, 7, 3, 6, 8, 9, 4, 7, 9, 1;
  EXPECT_EQ(DualQuadricMatrix(q), expected);
  EXPECT_EQ(DualQuadricModel::Unpack(q.data()).center, Eigen::Vector3d(4, 7, 9));
}

TEST(Conventions, BoxIsUMinVMinUMaxVMax) {
  const Camera camera = CameraLookingForward();
  Eigen::Vector4d box;
  const Surface<double> wide_in_camera{{1, 2, 10}, Eigen::Vector3d(4, 1, 1).asDiagonal()};
  ASSERT_TRUE(ProjectToBox(wide_in_camera, camera, &box));
  EXPECT_LT(box[0], camera.cx + 40);
  EXPECT_LT(box[1], camera.cy + 80);
  EXPECT_GT(box[2], camera.cx + 40);
  EXPECT_GT(box[3], camera.cy + 80);
  EXPECT_GT(box[2] - box[0], 1.9 * (box[3] - box[1]));
}

// A ball that fills the field of view from edge to edge: sin of its half angle is r / z.
TEST(Conventions, TheImageSpansMinusHalfToWidthMinusHalf) {
  const Camera camera = CameraLookingForward();
  const double half_width = 320.0 / 400, half_height = 240.0 / 400;
  for (int axis = 0; axis < 2; ++axis) {
    const double sine = std::sin(std::atan(axis == 0 ? half_width : half_height));
    const Surface<double> ball{{0, 0, 10}, std::pow(10 * sine, 2) * Eigen::Matrix3d::Identity()};
    Eigen::Vector4d box;
    ASSERT_TRUE(ProjectToBox(ball, camera, &box));
    EXPECT_NEAR(box[axis], -0.5, 1e-11);
    EXPECT_NEAR(box[axis + 2], (axis == 0 ? 640 : 480) - 0.5, 1e-11);
  }
}

}  // namespace
}  // namespace dqslam
