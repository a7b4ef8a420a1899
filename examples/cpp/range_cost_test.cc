#include "range_cost.h"

#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>

#include <cmath>

#include "cost_checks.h"
#include "dqslam/costs/size_prior.h"
#include "random.h"

namespace dqslam {
namespace {

using Cost = RangeCost<Se2, EllipsoidModel>;

Vector9d SphereAt(const Eigen::Vector3d& center) {
  return EllipsoidFromAxes(center, Eigen::Vector3d::Constant(0.3), {0, 0, 0, 1});
}

TEST(RangeCost, ByHand) {  // 3 and 4 meters away make 5; measured 5.5 with a sigma of 0.25
  const CostPointer cost(Cost::Create(5.5, 0.25));
  const std::vector<Block> blocks = {PoseBlock<Se2>({1, 2, 0.7}),
                                     LandmarkBlock(SphereAt({4, 6, 0}))};
  EXPECT_DOUBLE_EQ(ResidualOf(*cost, blocks)[0], -2);
}

TEST(RangeCost, JacobiansMatchPerturbation) {
  Random random(1);
  const CostPointer cost(Cost::Create(2.0, 0.1));
  for (int trial = 0; trial < 30; ++trial) {
    const Eigen::Vector3d center(random.Uniform(5, 8), random.Uniform(5, 8), random.Uniform(-1, 1));
    ExpectJacobiansMatchPerturbation(
        *cost, {PoseBlock<Se2>(random.RandomPose<Se2>()), LandmarkBlock(SphereAt(center))});
  }
}

TEST(RangeCost, FailsAtTheCenter) {
  const CostPointer cost(Cost::Create(1.0, 0.1));
  EXPECT_FALSE(IsDefined(*cost, {PoseBlock<Se2>({1, 2, 0}), LandmarkBlock(SphereAt({1, 2, 0}))}));
}

TEST(RangeCost, FourRangesFindAnObject) {
  const Eigen::Vector3d truth(1.5, -0.5, 2.0);
  Eigen::Matrix<double, 4, 7, Eigen::RowMajor> poses;
  poses << 0, 0, 0, 0, 0, 0, 1,  //
      3, 0, 0, 0, 0, 0, 1,       //
      0, 3, 0, 0, 0, 0, 1,       //
      0, 0, 3, 0, 0, 0, 1;
  Vector9d object = SphereAt({1, 1, 1});
  ceres::Problem problem;
  for (int i = 0; i < 4; ++i) {
    const double range = (truth - poses.row(i).head<3>().transpose()).norm();
    problem.AddResidualBlock(RangeCost<Se3, EllipsoidModel>::Create(range, 0.1),
                             nullptr,
                             poses.row(i).data(),
                             object.data());
    problem.SetParameterBlockConstant(poses.row(i).data());
  }
  // Ranges say nothing about the shape: the prior does.
  problem.AddResidualBlock(SizePriorCost::Create(std::log(0.2), 0.7), nullptr, object.data());
  ceres::Solver::Options options;
  options.function_tolerance = 1e-20;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  EXPECT_LT((object.head<3>() - truth).norm(), 1e-6);
  EXPECT_NEAR(object[3], std::log(0.2), 1e-6);
}

}  // namespace
}  // namespace dqslam
