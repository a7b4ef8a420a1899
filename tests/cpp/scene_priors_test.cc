#include "dqslam/costs/scene_priors.h"

#include <gtest/gtest.h>

#include "cost_checks.h"
#include "random.h"

namespace dqslam {
namespace {

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

std::vector<Block> Object(const Eigen::Vector3d& center,
                          const Eigen::Vector3d& semi_axes,
                          const Eigen::Vector4d& orientation) {
  return {LandmarkBlock(EllipsoidFromAxes(center, semi_axes, orientation))};
}

Eigen::Vector4d Turn(double angle, const Eigen::Vector3d& axis) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)).coeffs();
}

TEST(UprightCost, IsZeroForAnyYawAndGrowsWithTilt) {
  const CostPointer cost(UprightCost::Create(kUp, 0.5));
  for (const double yaw : {0.0, 0.7, 2.0}) {
    const std::vector<Block> upright =
        Object({1, 2, 3}, {0.2, 0.3, 0.9}, Turn(yaw, Eigen::Vector3d::UnitZ()));
    EXPECT_LT(ResidualOf(*cost, upright).norm(), 1e-14);
  }
  // A small tilt about x: angle times (1 - b^2 / c^2), here b = 0.3, c = 0.9.
  const double tilt = 1e-4;
  const std::vector<Block> tilted =
      Object({1, 2, 3}, {0.2, 0.3, 0.9}, Turn(tilt, Eigen::Vector3d::UnitX()));
  EXPECT_NEAR(ResidualOf(*cost, tilted).norm(), tilt * (1 - 1.0 / 9) / 0.5, 1e-9);
}

TEST(SupportPlaneCost, MeasuresTheLowestPoint) {
  const CostPointer cost(SupportPlaneCost::Create(kUp, 0.25, 0.1));  // ground at z = -0.25
  const Eigen::Vector4d level(0, 0, 0, 1);
  EXPECT_NEAR(ResidualOf(*cost, Object({5, 6, 0.65}, {0.2, 0.3, 0.9}, level))[0], 0, 1e-12);
  EXPECT_NEAR(ResidualOf(*cost, Object({5, 6, 0.85}, {0.2, 0.3, 0.9}, level))[0], 2, 1e-12);
}

TEST(CameraHeightCost, MeasuresTheCamera) {
  Camera camera;
  camera.robot_from_camera << 0.3, 0, 0.4, 0, 0, 0, 1;
  const CostPointer cost(CameraHeightCost<Se3>::Create(Mount(camera), kUp, 0.1, 1.2, 0.05));
  Eigen::Matrix<double, 7, 1> pose;
  pose << 1, 2, 0.8, 0, 0, 0, 1;  // camera at z = 1.2, that is 1.3 above z = -0.1
  EXPECT_NEAR(ResidualOf(*cost, {PoseBlock<Se3>(pose)})[0], (1.3 - 1.2) / 0.05, 1e-12);
}

TEST(ScenePriors, JacobiansMatchPerturbation) {
  Random random(1);
  Camera camera;
  camera.robot_from_camera << 0.3, 0, 0.4, random.UnitQuaternion();
  const Eigen::Vector3d up = random.UnitQuaternion().head<3>().normalized();
  const CostPointer upright(UprightCost::Create(up, 0.1));
  const CostPointer support(SupportPlaneCost::Create(up, 0.5, 0.1));
  const CostPointer height(CameraHeightCost<Se3>::Create(Mount(camera), up, 0.5, 1.0, 0.1));
  for (int trial = 0; trial < 30; ++trial) {
    const std::vector<Block> object = Object(
        random.UniformVector<3>(-3, 3), random.UniformVector<3>(0.2, 1), random.UnitQuaternion());
    ExpectJacobiansMatchPerturbation(*upright, object);
    ExpectJacobiansMatchPerturbation(*support, object);
    ExpectJacobiansMatchPerturbation(*height, {PoseBlock<Se3>(random.RandomPose<Se3>())});
  }
}

}  // namespace
}  // namespace dqslam
