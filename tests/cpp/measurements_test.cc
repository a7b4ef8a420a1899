#include "dqslam/costs/measurements.h"

#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gtest/gtest.h>

#include <cmath>

#include "cost_checks.h"
#include "dqslam/costs/size_prior.h"
#include "dqslam/estimation/covariance.h"
#include "dqslam/estimation/solve.h"
#include "random.h"
#include "scene.h"

namespace dqslam {
namespace {

using Cost = RangeCost<Se2, EllipsoidModel>;

Eigen::Matrix<double, 1, 1> One(double value) {
  return Eigen::Matrix<double, 1, 1>(value);
}

Vector9d SphereAt(const Eigen::Vector3d& center) {
  return EllipsoidFromAxes(center, Eigen::Vector3d::Constant(0.3), {0, 0, 0, 1});
}

TEST(RangeCost, ByHand) {  // 3 and 4 meters away make 5; measured 5.5 with a sigma of 0.25
  const CostPointer cost(Cost::Create(One(5.5), One(4)));
  const std::vector<Block> blocks = {PoseBlock<Se2>({1, 2, 0.7}),
                                     LandmarkBlock(SphereAt({4, 6, 0}))};
  EXPECT_DOUBLE_EQ(ResidualOf(*cost, blocks)[0], -2);
}

TEST(RangeCost, JacobiansMatchPerturbation) {
  Random random(1);
  const CostPointer cost(Cost::Create(One(2), One(10)));
  for (int trial = 0; trial < 30; ++trial) {
    const Eigen::Vector3d center(random.Uniform(5, 8), random.Uniform(5, 8), random.Uniform(-1, 1));
    ExpectJacobiansMatchPerturbation(
        *cost, {PoseBlock<Se2>(random.RandomPose<Se2>()), LandmarkBlock(SphereAt(center))});
  }
}

TEST(RangeCost, FailsAtTheCenter) {
  const CostPointer cost(Cost::Create(One(1), One(10)));
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
    problem.AddResidualBlock(RangeCost<Se3, EllipsoidModel>::Create(One(range), One(10)),
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

TEST(MeasurementKinds, AreFoundByName) {
  for (int kind = 0; kind < kNumMeasurementKinds; ++kind) {
    EXPECT_EQ(MeasurementKind(MeasurementName(kind)), kind);
  }
  EXPECT_EQ(MeasurementKind("position"), 0);
  EXPECT_EQ(MeasurementSize(0), 3);
  EXPECT_EQ(MeasurementSize(MeasurementKind("range")), 1);
  EXPECT_EQ(MeasurementKind("color"), -1);
}

// An object that its boxes leave at a wrong depth comes to where three ranges say.
TEST(MeasurementKinds, RangesReachTheEstimateAndItsCovariance) {
  Scene scene = MakeScene<Se2>();
  Graph& graph = scene.graph;
  graph.boxes.covariance *= 1e6;
  const SolveOptions options;
  const double sigma = 0.01;
  graph.measurements = {{"range",
                         IndexVector::LinSpaced(3, 0, 30),
                         IndexVector::Constant(3, 1),
                         RowMatrix(3, 1),
                         RowMatrix::Constant(3, 1, sigma * sigma)}};
  const Eigen::Vector3d center = scene.truth.landmarks.row(1).head<3>();
  for (int row = 0; row < 3; ++row) {
    const Eigen::RowVectorXd robot = scene.truth.poses.row(graph.measurements[0].pose[row]);
    graph.measurements[0].value(row, 0) = (center - Eigen::Vector3d(robot[0], robot[1], 0)).norm();
  }
  const Covariance with_ranges = ComputeCovariance(graph, options, scene.truth);
  State start = scene.truth;
  start.landmarks.row(1).head<3>() += Eigen::RowVector3d(0.3, -0.2, 0.1);
  const Solution solution = Solve(graph, options, start);
  EXPECT_LT((solution.landmarks.row(1).head<3>().transpose() - center).norm(), 1e-3);
  graph.measurements.clear();
  const Covariance without = ComputeCovariance(graph, options, scene.truth);
  EXPECT_LT(with_ranges.objects(1, 0), 0.2 * without.objects(1, 0));
  EXPECT_LT(with_ranges.objects(1, 10), 0.2 * without.objects(1, 10));
}

}  // namespace
}  // namespace dqslam
