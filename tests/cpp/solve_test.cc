#include "dqslam/solve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "scene.h"

namespace dqslam {
namespace {

using testing::HasSubstr;

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
  EXPECT_GT(solution.summary.initial_cost, 1);
}

// Only the initial poses are wrong, by metres at the end of the loop; every start and minimiser.
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
      // Up to the rounding that normalises quaternions.
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
    return Solve(graph, options_, scene_.truth).summary.initial_cost;
  }
  void ExpectThrow(const std::string& message, const std::function<void()>& call) {
    try {
      call();
      ADD_FAILURE() << "no exception: " << message;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
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
  graph.positions.pose = IndexVector::Constant(1, 0);
  graph.positions.object = IndexVector::Constant(1, 2);
  const Eigen::Vector3d center = scene_.truth.landmarks.row(2).head<3>();
  // The robot starts at (5, 0) and drives along +y: its left is -x.
  graph.positions.object_in_robot = RowMatrix(1, 3);
  graph.positions.object_in_robot << center.y(), 5 - center.x(), center.z() + 0.2;
  graph.positions.covariance = 0.01 * Eigen::Matrix3d::Identity().reshaped().transpose();
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

TEST_F(SolveTest, RefusesAStartOfTheWrongShape) {
  const std::string message = "start: need finite poses (40, 3) and landmarks (5, 9)";
  const auto refuse = [&](const std::function<void(State&)>& spoil) {
    State start = scene_.truth;
    spoil(start);
    ExpectThrow(message, [&] { Solve(scene_.graph, options_, start); });
  };
  refuse([](State& start) { start.poses.conservativeResize(39, 3); });
  refuse([](State& start) { start.poses = RowMatrix::Zero(40, 7); });
  refuse([](State& start) { start.landmarks.conservativeResize(4, 9); });
  refuse([](State& start) { start.landmarks = RowMatrix::Zero(5, 10); });
  refuse([](State& start) { start.poses(3, 1) = std::nan(""); });
  refuse([](State& start) { start.landmarks(0, 0) = std::numeric_limits<double>::infinity(); });
}

TEST_F(SolveTest, RefusesAStartWhoseQuaternionsAreNotUnit) {
  const Scene scene = MakeScene<Se3>(3, 0.05);
  State start = scene.truth;
  start.poses.row(1).tail(4) *= 2;
  ExpectThrow("start: the quaternions", [&] { Solve(scene.graph, options_, start); });
}

TEST_F(SolveTest, RefusesBadInputBeforeItReachesCeres) {
  Graph graph = scene_.graph;
  graph.boxes.box(3, 0) = std::nan("");
  ExpectThrow("boxes row 3", [&] { Solve(graph, options_, {}); });
  graph = scene_.graph;
  graph.odometry = OdometryTable();
  ExpectThrow("initial_poses row 1: no odometry", [&] { Solve(graph, options_, {}); });
}

TEST_F(SolveTest, RefusesOptionsThatAreNotPositive) {
  const std::pair<const char*, std::function<void(SolveOptions&, double)>> cases[] = {
      {"algebraic_sigma", [](SolveOptions& o, double v) { o.algebraic_sigma = v; }},
      {"loss_scale", [](SolveOptions& o, double v) { o.loss_scale = v; }},
      {"outlier_chi_square", [](SolveOptions& o, double v) { o.outlier_chi_square = v; }},
      {"max_iterations", [](SolveOptions& o, double v) { o.max_iterations = v; }},
      {"function_tolerance", [](SolveOptions& o, double v) { o.function_tolerance = v; }},
      {"grow_poses", [](SolveOptions& o, double v) { o.grow_poses = v; }},
      {"grow_iterations", [](SolveOptions& o, double v) { o.grow_iterations = v; }},
      {"grow_min_views", [](SolveOptions& o, double v) { o.grow_min_views = v; }},
  };
  for (const auto& [name, set] : cases) {
    for (const double bad : {0.0, -1.0}) {
      SolveOptions options;
      set(options, bad);
      ExpectThrow(std::string(name) + " must be positive",
                  [&] { Solve(scene_.graph, options, {}); });
    }
  }
}

// One box of one object of known size, started a hundred times too far away: the size of a box is
// 1 / depth, so that a Gauss-Newton step overshoots to behind the camera, into impossible geometry.
TEST_F(SolveTest, SaysThatEveryStepWasRejected) {
  Graph graph = scene_.graph;
  BoxTable& boxes = graph.boxes;
  ASSERT_EQ(boxes.object[0], 0);
  boxes.pose.conservativeResize(1);
  boxes.object.conservativeResize(1);
  boxes.box.conservativeResize(1, 4);
  boxes.covariance.conservativeResize(1, 16);
  boxes.truncated.conservativeResize(1, 4);
  graph.size_prior.log_mean.conservativeResize(1);
  graph.size_prior.log_sigma.conservativeResize(1);
  graph.size_prior.log_sigma[0] = 1e-3;
  State start{scene_.truth.poses, scene_.truth.landmarks.topRows(1)};
  const Eigen::Vector3d camera =
      LocateCamera<Se2>(start.poses.row(boxes.pose[0]).data(), Mount(graph.camera)).position;
  const Eigen::Vector3d center = start.landmarks.row(0).head<3>();
  start.landmarks.row(0) =
      Sphere(camera + 100 * (center - camera), std::exp(graph.size_prior.log_mean[0]));

  options_.mode = Mode::kMapping;
  options_.residual = Residual::kBox;
  options_.max_iterations = 1;
  const Solution solution = Solve(graph, options_, start);
  const Summary& summary = solution.summary;
  EXPECT_EQ(solution.landmarks, start.landmarks);
  EXPECT_EQ(summary.rejected_steps, 1);
  EXPECT_FALSE(summary.converged);
  EXPECT_THAT(summary.message,
              testing::StartsWith("every step was rejected: stopped after 1 iteration"));
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
}

// Q* = I has no real surface, so that no tangent plane exists.
TEST_F(SolveTest, SaysThatTheStartIsUndefined) {
  options_.start = Start::kIdentity;
  options_.landmark_model = LandmarkModel::kDualQuadric;
  options_.schedule = Schedule::kBatch;
  const Solution solution = Solve(scene_.graph, options_, {});
  EXPECT_FALSE(solution.summary.converged);
  EXPECT_THAT(solution.summary.message, HasSubstr("undefined at the start"));
  EXPECT_TRUE(std::isinf(solution.summary.final_cost)) << ToString(solution.summary);
  EXPECT_EQ(solution.summary.rejected_steps, 0);
  EXPECT_EQ(solution.summary.iterations, 0);
}

}  // namespace
}  // namespace dqslam
