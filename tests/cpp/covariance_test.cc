#include "dqslam/estimation/covariance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dqslam/estimation/solve.h"
#include "scene.h"

namespace dqslam {
namespace {

Eigen::MatrixXd Square(const RowMatrix& table, int row) {
  const int size = static_cast<int>(std::lround(std::sqrt(table.cols())));
  return Eigen::Map<const RowMatrix>(table.row(row).data(), size, size);
}

TEST(ComputeCovariance, FixesTheFirstPoseAndGrowsAlongOdometry) {
  Scene scene = MakeScene<Se2>();
  scene.graph.boxes = {
      IndexVector(0), IndexVector(0), RowMatrix(0, 4), RowMatrix(0, 16), BoolTable(0, 4)};
  scene.graph.size_prior = {Eigen::VectorXd(0), Eigen::VectorXd(0)};
  State state{scene.truth.poses, RowMatrix(0, kLandmarkSize)};
  const Covariance covariance = ComputeCovariance(scene.graph, SolveOptions(), state);
  EXPECT_EQ(covariance.poses.row(0).norm(), 0);
  // The first step: the covariance of odometry itself, 0.02 m and 0.02 rad.
  EXPECT_LT((Square(covariance.poses, 1) - 4e-4 * Eigen::Matrix3d::Identity()).norm(), 1e-10);
  // Heading: a random walk.
  for (const int pose : {5, 20, 39}) {
    EXPECT_NEAR(Square(covariance.poses, pose)(2, 2), 4e-4 * pose, 1e-8);
  }
  EXPECT_TRUE(covariance.under_constrained.empty());
}

// Halving all sigmas quarters all covariances: a wrong factor of two in any term would show.
TEST(ComputeCovariance, ScalesWithTheNoise) {
  Scene scene = MakeScene<Se3>();
  const SolveOptions options;
  const Covariance wide = ComputeCovariance(scene.graph, options, scene.truth);
  scene.graph.boxes.covariance /= 4;
  scene.graph.odometry.covariance /= 4;
  const Covariance narrow = ComputeCovariance(scene.graph, options, scene.truth);
  EXPECT_LT((wide.poses - 4 * narrow.poses).norm(), 1e-6 * wide.poses.norm());
  EXPECT_LT((wide.objects - 4 * narrow.objects).norm(), 1e-6 * wide.objects.norm());
}

// Monte Carlo: the spread of estimates from noisy boxes is what the covariance says.
TEST(ComputeCovariance, PredictsTheSpreadOfEstimates) {
  constexpr int kRuns = 150;
  Scene scene = MakeScene<Se2>();
  SolveOptions options;
  options.mode = Mode::kMapping;
  const Covariance covariance = ComputeCovariance(scene.graph, options, scene.truth);
  EXPECT_EQ(covariance.poses.norm(), 0);
  const RowMatrix exact = scene.graph.boxes.box;
  Random random(3);
  double nees = 0;
  for (int run = 0; run < kRuns; ++run) {
    scene.graph.boxes.box =
        exact + RowMatrix::NullaryExpr(
                    exact.rows(), 4, [&](Eigen::Index, Eigen::Index) { return random.Normal(); });
    const Solution solution = Solve(scene.graph, options, scene.truth);
    for (int object = 0; object < scene.graph.num_objects(); ++object) {
      const Eigen::Vector3d error =
          (solution.landmarks.row(object) - scene.truth.landmarks.row(object)).head<3>();
      const Eigen::Matrix3d center = Square(covariance.objects, object).topLeftCorner<3, 3>();
      nees += error.dot(center.inverse() * error);
    }
  }
  // Chi-square with 3 x 5 x 150 = 2250 degrees of freedom: 99.9 % within 10 % of its mean.
  EXPECT_NEAR(nees / (3 * scene.graph.num_objects() * kRuns), 1, 0.1);
}

TEST(ComputeCovariance, NamesAnObjectThatNothingDeterminesAndReturnsTheRest) {
  Scene scene = MakeScene<Se2>();
  BoxTable& boxes = scene.graph.boxes;
  int kept = 0;  // of object 2, one box remains; the prior is as good as none
  for (int row = 0; row < boxes.size(); ++row) {
    if (boxes.object[row] == 2 && kept++ > 0) boxes.object[row] = 1;
  }
  const Covariance covariance = ComputeCovariance(scene.graph, SolveOptions(), scene.truth);
  ASSERT_EQ(covariance.under_constrained.size(), 1u);
  EXPECT_EQ(covariance.under_constrained[0].kind, VariableKind::kObject);
  EXPECT_EQ(covariance.under_constrained[0].row, 2);
  EXPECT_TRUE(covariance.objects.row(2).hasNaN());
  EXPECT_TRUE(covariance.objects.row(1).allFinite());
  EXPECT_TRUE(covariance.poses.allFinite());
}

TEST(ComputeJointCovariance, HasTheMarginalsOnItsDiagonal) {
  const Scene scene = MakeScene<Se3>(12);
  const SolveOptions options;
  const Covariance marginal = ComputeCovariance(scene.graph, options, scene.truth);
  const RowMatrix joint =
      ComputeJointCovariance(scene.graph, options, scene.truth, {7, 0, 3}, {4, 1});
  ASSERT_EQ(joint.rows(), 3 * 6 + 2 * 9);
  EXPECT_LT((joint - joint.transpose()).norm(), 1e-9 * joint.norm());
  const auto expect_block = [&joint](int start, const Eigen::MatrixXd& expected) {
    const int size = static_cast<int>(expected.rows());
    EXPECT_LT((joint.block(start, start, size, size) - expected).norm(), 1e-9 * expected.norm())
        << "block at " << start;
  };
  expect_block(0, Square(marginal.poses, 7));
  EXPECT_EQ(joint.middleRows(6, 6).norm(), 0);  // the first pose is the gauge
  expect_block(12, Square(marginal.poses, 3));
  expect_block(18, Square(marginal.objects, 4));
  expect_block(27, Square(marginal.objects, 1));
  // Drift is common to a pose and what it sees: the difference is better known than either.
  EXPECT_GT(joint.block(0, 18, 6, 9).norm(), 0);
  EXPECT_THROW(ComputeJointCovariance(scene.graph, options, scene.truth, {12}, {}),
               std::invalid_argument);
  EXPECT_THROW(ComputeJointCovariance(scene.graph, options, scene.truth, {}, {5}),
               std::invalid_argument);
}

TEST(ComputeFit, OdometryAloneFitsPerfectly) {
  Scene scene = MakeScene<Se2>();
  scene.graph.boxes = {
      IndexVector(0), IndexVector(0), RowMatrix(0, 4), RowMatrix(0, 16), BoolTable(0, 4)};
  scene.graph.size_prior = {Eigen::VectorXd(0), Eigen::VectorXd(0)};
  const State state{scene.truth.poses, RowMatrix(0, kLandmarkSize)};
  const Fit fit = ComputeFit(scene.graph, SolveOptions(), state);
  EXPECT_LT(fit.odometry_residuals.cwiseAbs().maxCoeff(), 1e-9);
  EXPECT_LT((fit.odometry_leverage.array() - 1).abs().maxCoeff(), 1e-6);
}

// The squared residual of a measurement is 1 - leverage in the mean: what variance components
// are estimated by.
TEST(ComputeFit, LeverageTellsTheMeanSquaredResidual) {
  constexpr int kRuns = 40;
  Scene scene = MakeScene<Se2>();
  const OdometryTable exact = scene.graph.odometry;
  const RowMatrix boxes = scene.graph.boxes.box;
  SolveOptions options;
  Random random(5);
  double squares = 0, redundancy = 0, box_squares = 0, box_redundancy = 0;
  for (int run = 0; run < kRuns; ++run) {
    for (int edge = 0; edge < exact.size(); ++edge) {
      const Eigen::Vector3d noise =
          0.02 * Eigen::Vector3d::NullaryExpr([&](Eigen::Index) { return random.Normal(); });
      Plus<Se2>(exact.relative.row(edge).data(),
                noise.data(),
                scene.graph.odometry.relative.row(edge).data());
    }
    scene.graph.boxes.box = boxes;
    for (int i = 0; i < scene.graph.boxes.box.size(); ++i) {
      scene.graph.boxes.box.data()[i] += random.Normal();
    }
    const Solution solution = Solve(scene.graph, options, scene.truth);
    const State state{solution.poses, solution.landmarks};
    const Fit fit = ComputeFit(scene.graph, options, state);
    squares += fit.odometry_residuals.squaredNorm();
    redundancy += (1 - fit.odometry_leverage.array()).sum();
    box_squares += fit.box_squares;
    box_redundancy += fit.box_redundancy;
  }
  EXPECT_GT(redundancy, 500);
  EXPECT_NEAR(squares / redundancy, 1, 0.15);  // 4 sigmas of a chi-square of 1400
  EXPECT_GT(box_redundancy, 10000);
  EXPECT_NEAR(box_squares / box_redundancy, 1, 0.04);
}

TEST(ComputeCovariance, RefusesAStateThatDoesNotFit) {
  Scene scene = MakeScene<Se2>();
  State state = scene.truth;
  state.poses.conservativeResize(3, 3);
  EXPECT_THROW(ComputeCovariance(scene.graph, SolveOptions(), state), std::invalid_argument);
}

}  // namespace
}  // namespace dqslam
