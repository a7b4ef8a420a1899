#include "dqslam/estimation/solve.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "scene.h"

namespace dqslam {
namespace {

template <typename Pose>
double LargestPoseError(const RowMatrix& poses, const RowMatrix& truth) {
  double largest = 0;
  for (Eigen::Index row = 0; row < poses.rows(); ++row) {
    Eigen::Matrix<double, Pose::kTangentSize, 1> error;
    Minus<Pose>(poses.row(row).data(), truth.row(row).data(), error.data());
    largest = std::max(largest, error.cwiseAbs().maxCoeff());
  }
  return largest;
}

/// Chains the true steps, each turned and shifted by a random tangent of size `sigma`.
template <typename Pose>
RowMatrix Drift(const RowMatrix& relative, RowMatrix poses, double sigma) {
  Random random(5);
  for (Eigen::Index row = 0; row < relative.rows(); ++row) {
    const Eigen::Matrix<double, Pose::kTangentSize, 1> error =
        sigma * random.RandomTangent<Pose>(1);
    Eigen::Matrix<double, Pose::kSize, 1> step;
    Plus<Pose>(relative.row(row).data(), error.data(), step.data());
    Pose::Compose(poses.row(row).data(), step.data(), poses.row(row + 1).data());
  }
  return poses;
}

RowMatrix AsDualQuadrics(const RowMatrix& ellipsoids) {
  RowMatrix quadrics = ellipsoids;
  for (Eigen::Index row = 0; row < ellipsoids.rows(); ++row) {
    quadrics.row(row) = DualQuadricFromEllipsoid(ellipsoids.row(row).transpose());
  }
  return quadrics;
}

template <typename Pose>
const Scene& SharedScene() {
  static const Scene scene = MakeScene<Pose>();
  return scene;
}

template <typename Pose>
class SolveOf : public testing::Test {
 protected:
  void ExpectTruth(const Solution& solution, double tolerance = 1e-6) {
    EXPECT_LT(LargestPoseError<Pose>(solution.poses, scene_.truth.poses), tolerance)
        << ToString(solution.summary);
    const RowMatrix quadrics = AsDualQuadrics(scene_.truth.landmarks);
    EXPECT_LT((solution.dual_quadrics - quadrics).cwiseAbs().maxCoeff(), tolerance)
        << ToString(solution.summary);
  }

  const Scene& scene_ = SharedScene<Pose>();
  SolveOptions options_;
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(SolveOf, PoseTypes);

TYPED_TEST(SolveOf, RecoversTheTruthByDefault) {
  const Solution solution = Solve(this->scene_.graph, this->options_, {});
  this->ExpectTruth(solution);
  EXPECT_LT((solution.landmarks - this->scene_.truth.landmarks).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_TRUE(solution.summary.converged) << ToString(solution.summary);
  EXPECT_LT(solution.summary.final_cost, 1e-7);
}

// Only the initial poses are wrong, by meters at the end of the loop; every start and minimizer.
TYPED_TEST(SolveOf, RecoversTheTruthFromDriftedInitialPoses) {
  Graph graph = this->scene_.graph;
  graph.initial_poses = Drift<TypeParam>(graph.odometry.relative, this->scene_.truth.poses, 0.05);
  EXPECT_GT(LargestPoseError<TypeParam>(graph.initial_poses, this->scene_.truth.poses), 0.5);
  this->options_.schedule = Schedule::kBatch;
  for (const Start start : {Start::kSvd, Start::kSizePrior, Start::kSphere}) {
    for (const Minimizer minimizer : {Minimizer::kDogleg, Minimizer::kLevenbergMarquardt}) {
      this->options_.start = start;
      this->options_.minimizer = minimizer;
      this->ExpectTruth(Solve(graph, this->options_, {}));
    }
  }
}

TYPED_TEST(SolveOf, EveryResidualHasItsMinimumAtTheTruth) {
  State truth = this->scene_.truth;
  for (const LandmarkModel model : {LandmarkModel::kEllipsoid, LandmarkModel::kDualQuadric}) {
    if (model == LandmarkModel::kDualQuadric) truth.landmarks = AsDualQuadrics(truth.landmarks);
    for (const Residual residual : {Residual::kAlgebraic,
                                    Residual::kAlgebraicNormalized,
                                    Residual::kTangent,
                                    Residual::kBox,
                                    Residual::kTangentThenBox}) {
      this->options_.landmark_model = model;
      this->options_.residual = residual;
      const Solution solution = Solve(this->scene_.graph, this->options_, truth);
      this->ExpectTruth(solution, 1e-9);
      EXPECT_LT(solution.summary.final_cost, 1e-7) << static_cast<int>(residual);
    }
  }
}

// Boxes alone: poses are known, there is no odometry.
TYPED_TEST(SolveOf, MappingRecoversObjectsAndLeavesPoses) {
  Graph graph = this->scene_.graph;
  graph.odometry = OdometryTable();
  this->options_.mode = Mode::kMapping;
  for (const LandmarkModel model : {LandmarkModel::kEllipsoid, LandmarkModel::kDualQuadric}) {
    for (const Residual residual : {Residual::kAlgebraic,
                                    Residual::kAlgebraicNormalized,
                                    Residual::kTangent,
                                    Residual::kBox,
                                    Residual::kTangentThenBox}) {
      this->options_.landmark_model = model;
      this->options_.residual = residual;
      const Solution solution = Solve(graph, this->options_, {});
      // Up to the rounding that normalizes quaternions.
      EXPECT_LT((solution.poses - this->scene_.truth.poses).cwiseAbs().maxCoeff(), 1e-15);
      this->ExpectTruth(solution);
    }
  }
}

// A narrower image: boxes end at its border and say so.
TYPED_TEST(SolveOf, RecoversTheTruthFromTruncatedBoxes) {
  Graph graph = this->scene_.graph;
  graph.camera.width = 381;
  int truncated = 0;
  for (int row = 0; row < graph.boxes.size(); ++row) {
    if (graph.boxes.box(row, 2) <= 380.5 || graph.boxes.box(row, 0) > 350) continue;
    graph.boxes.box(row, 2) = 380.5;
    graph.boxes.truncated(row, 2) = true;
    ++truncated;
  }
  EXPECT_GT(truncated, 10);
  this->ExpectTruth(Solve(graph, this->options_, {}));
}

TYPED_TEST(SolveOf, SameInputGivesTheSameBits) {
  Graph graph = this->scene_.graph;
  Random random(6);
  for (double& edge : graph.boxes.box.reshaped()) edge += random.Normal();
  for (const Schedule schedule : {Schedule::kGrow, Schedule::kBatch}) {
    this->options_.schedule = schedule;
    const Solution first = Solve(graph, this->options_, {});
    for (int repeat = 0; repeat < 3; ++repeat) {
      const Solution again = Solve(graph, this->options_, {});
      EXPECT_EQ(again.poses, first.poses);
      EXPECT_EQ(again.landmarks, first.landmarks);
      EXPECT_EQ(again.summary.final_cost, first.summary.final_cost);
      EXPECT_EQ(again.summary.iterations, first.summary.iterations);
    }
  }
}

class SolveTest : public testing::Test {
 protected:
  /// Cost at the truth.
  double CostAtTruth(const Graph& graph) {
    options_.max_iterations = 1;
    if (options_.loss == Loss::kGncTls) options_.loss = Loss::kNone;
    return Solve(graph, options_, scene_.truth).summary.initial_cost;
  }

  const Scene& scene_ = SharedScene<Se2>();
  SolveOptions options_;
};

// One edge 4 px off at a sigma of 2 px: 2 sigmas, so half their square.
TEST_F(SolveTest, CostIsHalfTheSquaredSigmas) {
  Graph graph = scene_.graph;
  graph.boxes.covariance.row(7) *= 4;
  graph.boxes.box(7, 2) += 4;
  EXPECT_NEAR(CostAtTruth(graph), 2, 1e-5);
  options_.loss_scale = 0.5;
  options_.loss = Loss::kHuber;  // 0.5 (2 - 0.25 ...): rho(s) = 2 d sqrt(s) - d^2
  EXPECT_NEAR(CostAtTruth(graph), 0.5 * (2 * 0.5 * 2 - 0.25), 1e-5);
  options_.loss = Loss::kCauchy;  // rho(s) = d^2 log(1 + s / d^2)
  EXPECT_NEAR(CostAtTruth(graph), 0.5 * 0.25 * std::log(1 + 4 / 0.25), 1e-5);
}

TEST_F(SolveTest, CostCountsOdometryAndPositionsAndSizes) {
  Graph graph = scene_.graph;
  graph.odometry.relative(3, 1) += 0.06;  // three sigmas of 0.02 m
  EXPECT_NEAR(CostAtTruth(graph), 4.5, 1e-6);

  graph = scene_.graph;
  const Eigen::Vector3d center = scene_.truth.landmarks.row(2).head<3>();
  // The robot starts at (5, 0) and drives along +y: its left is -x.
  const Eigen::RowVector3d object_in_robot(center.y(), 5 - center.x(), center.z() + 0.2);
  graph.measurements = {{"position",
                         IndexVector::Constant(1, 0),
                         IndexVector::Constant(1, 2),
                         object_in_robot,
                         0.01 * Eigen::Matrix3d::Identity().reshaped().transpose()}};
  EXPECT_NEAR(CostAtTruth(graph), 2, 1e-6);

  graph = scene_.graph;
  graph.size_prior.log_sigma.setConstant(0.5);
  double expected = 0;
  for (const oracle::Ellipsoid& e : SceneObjects()) {
    expected += 0.5 * ((e.semi_axes / 0.3).array().log() / 0.5).square().sum();
  }
  EXPECT_NEAR(CostAtTruth(graph), expected, 1e-6);
}

// All objects start on the far side of the cameras: the box residual is undefined there, so boxes
// use the tangent residual until they are defined.
TEST_F(SolveTest, BoxResidualFallsBackToTangentBehindTheCamera) {
  options_.mode = Mode::kMapping;
  State start = scene_.truth;
  for (Eigen::Index row = 0; row < start.landmarks.rows(); ++row) {
    start.landmarks.row(row) = Sphere({12, 0, 0}, 0.3);
  }
  const Solution solution = Solve(scene_.graph, options_, start);
  EXPECT_LT((solution.landmarks - scene_.truth.landmarks).cwiseAbs().maxCoeff(), 1e-6)
      << ToString(solution.summary);
}

TEST_F(SolveTest, ReportsSingularValuesOfTheSvdStartOnly) {
  EXPECT_TRUE(Solve(scene_.graph, options_, {}).svd_singular_values.array().isNaN().all());
  options_.start = Start::kSvd;
  const RowMatrix values = Solve(scene_.graph, options_, {}).svd_singular_values;
  ASSERT_EQ(values.rows(), 5);
  ASSERT_EQ(values.cols(), 10);
  EXPECT_LT((values.col(9).array() / values.col(0).array()).maxCoeff(), 1e-8);
  EXPECT_GT((values.col(8).array() / values.col(0).array()).minCoeff(), 1e-3);
}

TEST_F(SolveTest, StopsWhenTheMonitorAsksTo) {
  int calls = 0;
  EXPECT_THROW(Solve(scene_.graph, options_, {}, [&] { return ++calls < 3; }), Interrupted);
  EXPECT_EQ(calls, 3);
  int all_calls = 0;
  EXPECT_NO_THROW(Solve(scene_.graph, options_, {}, [&] { return ++all_calls > 0; }));
  EXPECT_GT(all_calls, 3);
}

}  // namespace
}  // namespace dqslam
