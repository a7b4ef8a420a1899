// Input that is refused, and what a summary says where a solve fails.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>

#include "dqslam/estimation/solve.h"
#include "scene.h"

namespace dqslam {
namespace {

using testing::HasSubstr;

class SolveFailures : public testing::Test {
 protected:
  void ExpectThrow(const std::string& message, const std::function<void()>& call) {
    try {
      call();
      ADD_FAILURE() << "no exception: " << message;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  }

  const Scene scene_ = MakeScene<Se2>();
  SolveOptions options_;
};

TEST_F(SolveFailures, RefusesAStartOfTheWrongShape) {
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

TEST_F(SolveFailures, RefusesAStartWhoseQuaternionsAreNotUnit) {
  const Scene scene = MakeScene<Se3>(3, 0.05);
  State start = scene.truth;
  start.poses.row(1).tail(4) *= 2;
  ExpectThrow("start: the quaternions", [&] { Solve(scene.graph, options_, start); });
}

TEST_F(SolveFailures, RefusesBadInputBeforeItReachesCeres) {
  Graph graph = scene_.graph;
  graph.boxes.box(3, 0) = std::nan("");
  ExpectThrow("boxes row 3", [&] { Solve(graph, options_, {}); });
  graph = scene_.graph;
  graph.odometry = OdometryTable();
  ExpectThrow("initial_poses row 1: no odometry", [&] { Solve(graph, options_, {}); });
}

TEST_F(SolveFailures, RefusesOptionsThatAreNotPositive) {
  const std::pair<const char*, std::function<void(SolveOptions&, double)>> cases[] = {
      {"algebraic_sigma", [](SolveOptions& o, double v) { o.algebraic_sigma = v; }},
      {"loss_scale", [](SolveOptions& o, double v) { o.loss_scale = v; }},
      {"outlier_chi_square", [](SolveOptions& o, double v) { o.outlier_chi_square = v; }},
      {"max_iterations", [](SolveOptions& o, double v) { o.max_iterations = v; }},
      {"function_tolerance", [](SolveOptions& o, double v) { o.function_tolerance = v; }},
      {"grow_poses", [](SolveOptions& o, double v) { o.grow_poses = v; }},
      {"grow_iterations", [](SolveOptions& o, double v) { o.grow_iterations = v; }},
      {"grow_min_views", [](SolveOptions& o, double v) { o.grow_min_views = v; }},
      {"threads", [](SolveOptions& o, double v) { o.threads = v; }},
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
TEST_F(SolveFailures, SaysThatNoStepWasGood) {
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
  options_.loss = Loss::kNone;
  options_.residual = Residual::kBox;
  options_.max_iterations = 1;
  const Solution solution = Solve(graph, options_, start);
  const Summary& summary = solution.summary;
  EXPECT_EQ(solution.landmarks, start.landmarks);
  EXPECT_EQ(summary.rejected_steps, 1);
  EXPECT_FALSE(summary.converged);
  EXPECT_THAT(summary.message,
              testing::AnyOf(testing::HasSubstr("stopped after 1 iteration"),
                             testing::HasSubstr("boxes do not fit")));
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
}

// Most boxes of an object are anywhere: the others fit, and the object's place is not certain.
TEST_F(SolveFailures, SaysThatMostBoxesOfAnObjectDoNotFit) {
  ASSERT_TRUE(Solve(scene_.graph, options_).summary.converged);
  Random random(5);
  Graph graph = scene_.graph;
  BoxTable& boxes = graph.boxes;
  int seen = 0;
  for (int row = 0; row < boxes.size(); ++row) {
    if (boxes.object[row] != 1 || seen++ % 3 == 0) continue;
    const Eigen::Vector2d shift = random.UniformVector<2>(-300, 300);
    boxes.box.row(row) += Eigen::RowVector4d(shift[0], shift[1], shift[0], shift[1]);
  }
  ASSERT_GE(seen, 6);
  const Summary summary = Solve(graph, options_).summary;
  EXPECT_FALSE(summary.converged);
  EXPECT_EQ(summary.message, "most boxes of 1 object do not fit");
}

// Q* = I has no real surface, so that no tangent plane exists.
TEST_F(SolveFailures, SaysThatTheStartIsUndefined) {
  options_.start = Start::kIdentity;
  options_.landmark_model = LandmarkModel::kDualQuadric;
  options_.schedule = Schedule::kBatch;
  options_.residual = Residual::kTangent;
  EXPECT_THAT(Solve(scene_.graph, options_, {}).summary.message,
              HasSubstr("100 % of the boxes do not fit"));
  options_.loss = Loss::kNone;
  const Solution solution = Solve(scene_.graph, options_, {});
  EXPECT_FALSE(solution.summary.converged);
  EXPECT_THAT(solution.summary.message, HasSubstr("undefined at the start"));
  EXPECT_TRUE(std::isinf(solution.summary.final_cost)) << ToString(solution.summary);
  EXPECT_EQ(solution.summary.rejected_steps, 0);
  EXPECT_EQ(solution.summary.iterations, 0);
}

}  // namespace
}  // namespace dqslam
