#include "dqslam/problem/graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "scene.h"

namespace dqslam {
namespace {

using testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNan = std::nan("");

/// Three poses, with a measured position.
template <typename Pose>
Graph GoodGraph() {
  static const Scene scene = MakeScene<Pose>(3, 0.05);
  Graph graph = scene.graph;
  graph.measurements = {{"position",
                         IndexVector::Constant(1, 2),
                         IndexVector::Constant(1, 1),
                         RowMatrix::Ones(1, 3),
                         Eigen::Matrix3d::Identity().reshaped().transpose()}};
  return graph;
}

struct BadInput {
  std::string message;
  std::function<void(Graph&)> spoil;
};

template <typename Pose>
void ExpectRefused(const std::vector<BadInput>& cases) {
  for (const BadInput& bad : cases) {
    Graph graph = GoodGraph<Pose>();
    bad.spoil(graph);
    try {
      Validate(graph, /*poses_known=*/false);
      ADD_FAILURE() << "no exception: " << bad.message;
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), HasSubstr(bad.message));
    }
  }
}

TEST(Validate, AcceptsTheGoodGraphs) {
  EXPECT_NO_THROW(Validate(GoodGraph<Se2>(), false));
  EXPECT_NO_THROW(Validate(GoodGraph<Se3>(), false));
}

TEST(Validate, NamesThePoseThatIsWrong) {
  const std::vector<BadInput> both = {
      {"initial_poses: need at least one pose", [](Graph& g) { g.initial_poses.resize(0, 3); }},
      {"initial_poses has shape (3, 2)", [](Graph& g) { g.initial_poses.resize(3, 2); }},
      {"initial_poses row 1: NaN", [](Graph& g) { g.initial_poses(1, 0) = kNan; }},
      {"initial_poses row 2: NaN or inf", [](Graph& g) { g.initial_poses(2, 1) = kInfinity; }},
      {"camera: fx", [](Graph& g) { g.camera.fx = 0; }},
  };
  ExpectRefused<Se2>(both);
  ExpectRefused<Se3>(both);
  ExpectRefused<Se3>({
      {"initial_poses row 1: the quaternion is not unit",
       [](Graph& g) { g.initial_poses.row(1).tail(4) *= 1.01; }},
      {"odometry row 1: the quaternion is not unit",
       [](Graph& g) { g.odometry.relative.row(1).tail(4).setZero(); }},
  });
}

TEST(Validate, NamesTheOdometryThatIsWrong) {
  const std::vector<BadInput> both = {
      {"odometry_from row 1: unknown id 3, there are 3", [](Graph& g) { g.odometry.from[1] = 3; }},
      {"odometry_to row 0: unknown id -1", [](Graph& g) { g.odometry.to[0] = -1; }},
      {"odometry_to has 1 entries, expected 2", [](Graph& g) { g.odometry.to.resize(1); }},
      {"odometry_to row 1: a pose follows itself", [](Graph& g) { g.odometry.to[1] = 1; }},
      {"odometry row 1: NaN", [](Graph& g) { g.odometry.relative(1, 2) = kNan; }},
      {"odometry has shape (2, 9)", [](Graph& g) { g.odometry.relative.resize(2, 9); }},
      {"odometry_covariance row 1: NaN", [](Graph& g) { g.odometry.covariance(1, 0) = kNan; }},
      {"odometry_covariance has shape (1, 9)",
       [](Graph& g) { g.odometry.covariance.resize(1, 9); }},
      {"odometry_covariance row 1: covariance is not symmetric positive definite",
       [](Graph& g) { g.odometry.covariance.row(1).setZero(); }},
      {"odometry_covariance row 0: covariance is not symmetric",
       [](Graph& g) { g.odometry.covariance(0, 1) = 1e-4; }},
      {"initial_poses row 2: no odometry leads to this pose",
       [](Graph& g) { std::swap(g.odometry.from[1], g.odometry.to[1]); }},
  };
  ExpectRefused<Se2>(both);
  ExpectRefused<Se3>(both);
}

TEST(Validate, NamesTheBoxThatIsWrong) {
  ExpectRefused<Se2>({
      {"box_pose row 1: unknown id 3", [](Graph& g) { g.boxes.pose[1] = 3; }},
      {"box_object row 0: unknown id 5, there are 5", [](Graph& g) { g.boxes.object[0] = 5; }},
      {"box_object row 0: unknown id -1", [](Graph& g) { g.boxes.object[0] = -1; }},
      {"boxes row 1: NaN", [](Graph& g) { g.boxes.box(1, 3) = kNan; }},
      {"boxes row 1: NaN or inf", [](Graph& g) { g.boxes.box(1, 0) = -kInfinity; }},
      {"boxes row 1: inverted or empty",
       [](Graph& g) { std::swap(g.boxes.box(1, 0), g.boxes.box(1, 2)); }},
      {"boxes row 0: inverted or empty", [](Graph& g) { g.boxes.box(0, 3) = g.boxes.box(0, 1); }},
      {"box_object has 2 entries", [](Graph& g) { g.boxes.object.resize(2); }},
      {"boxes has shape (2, 4)", [](Graph& g) { g.boxes.box.resize(2, 4); }},
      {"box_covariance has shape (2, 16)", [](Graph& g) { g.boxes.covariance.resize(2, 16); }},
      {"box_covariance row 1: NaN", [](Graph& g) { g.boxes.covariance(1, 5) = kNan; }},
      {"box_covariance row 1: covariance is not symmetric positive definite",
       [](Graph& g) { g.boxes.covariance.row(1).setOnes(); }},
      {"box_truncated has 2 rows", [](Graph& g) { g.boxes.truncated.resize(2, 4); }},
  });
}

TEST(Validate, NamesTheObjectThatIsWrong) {
  ExpectRefused<Se2>({
      {"log_size_mean row 5: no box shows this object",
       [](Graph& g) {
         g.size_prior.log_mean = Eigen::VectorXd::Zero(6);
         g.size_prior.log_sigma = Eigen::VectorXd::Ones(6);
       }},
      {"log_size_mean row 2: NaN", [](Graph& g) { g.size_prior.log_mean[2] = kNan; }},
      {"log_size_sigma row 2: NaN", [](Graph& g) { g.size_prior.log_sigma[2] = kNan; }},
      {"log_size_sigma row 3: must be positive", [](Graph& g) { g.size_prior.log_sigma[3] = 0; }},
      {"log_size_sigma row 3: must be positive", [](Graph& g) { g.size_prior.log_sigma[3] = -1; }},
      {"log_size_sigma has shape (4, 1)", [](Graph& g) { g.size_prior.log_sigma.resize(4); }},
      {"measurements: there is no kind 'color'",
       [](Graph& g) { g.measurements[0].kind = "color"; }},
      {"position_pose row 0: unknown id 7", [](Graph& g) { g.measurements[0].pose[0] = 7; }},
      {"position_object row 0: unknown id 7", [](Graph& g) { g.measurements[0].object[0] = 7; }},
      {"position_value row 0: NaN", [](Graph& g) { g.measurements[0].value(0, 1) = kNan; }},
      {"position_value has shape (1, 2)", [](Graph& g) { g.measurements[0].value.resize(1, 2); }},
      {"position_covariance has shape (0, 9)",
       [](Graph& g) { g.measurements[0].covariance.resize(0, 9); }},
      {"position_covariance row 0: covariance is not symmetric positive definite",
       [](Graph& g) { g.measurements[0].covariance *= -1; }},
  });
}

TEST(Validate, KnownPosesNeedNoOdometry) {
  Graph graph = GoodGraph<Se3>();
  graph.odometry = OdometryTable();
  EXPECT_NO_THROW(Validate(graph, /*poses_known=*/true));
  EXPECT_THROW(Validate(graph, /*poses_known=*/false), std::invalid_argument);
}

TEST(Append, AddsCountsAndKeepsTheFirstInitialCost) {
  Summary total, first, second;
  first.initial_cost = 10;
  first.final_cost = 5;
  first.iterations = 3;
  first.rejected_steps = 1;
  first.converged = true;
  first.message = "first";
  second.initial_cost = 4;
  second.final_cost = 2;
  second.iterations = 7;
  second.rejected_steps = 2;
  second.message = "second";
  Append(first, &total);
  Append(second, &total);
  EXPECT_EQ(total.initial_cost, 10);
  EXPECT_EQ(total.final_cost, 2);
  EXPECT_EQ(total.iterations, 10);
  EXPECT_EQ(total.rejected_steps, 3);
  EXPECT_FALSE(total.converged);
  EXPECT_EQ(total.message, "second");
}

TEST(ToString, SaysEverythingInOneLine) {
  Summary summary;
  summary.initial_cost = 12.5;
  summary.final_cost = 0.25;
  summary.iterations = 17;
  summary.rejected_steps = 4;
  summary.gradient_norm_start = 300;
  summary.gradient_norm_end = 0.001;
  summary.seconds = 0.125;
  summary.message = "step too small";
  EXPECT_EQ(ToString(summary),
            "did not converge: cost 12.5 -> 0.25 in 17 iterations (4 steps rejected), 0.125 s; "
            "gradient 300 -> 0.001; step too small");
  summary.converged = true;
  EXPECT_THAT(ToString(summary), testing::StartsWith("converged: cost"));
}

}  // namespace
}  // namespace dqslam
