#include "dqslam/solver/trust_region.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dqslam/estimation/repair.h"
#include "dqslam/estimation/solve.h"
#include "scene.h"

namespace dqslam {
namespace {

/// Rosenbrock's valley as residuals (10 (y - x^2), 1 - x), undefined for x < -2.
class Rosenbrock : public LeastSquares {
 public:
  Rosenbrock() : LeastSquares(BlockMatrix({1, 1}, {{0, 1}})) {}
  Eigen::VectorXd Pack(const State&) const override { return {}; }
  void Unpack(const Eigen::VectorXd&, State*) const override {}
  bool Retract(const Eigen::VectorXd& values,
               const Eigen::VectorXd& step,
               Eigen::VectorXd* moved) const override {
    *moved = values + step;
    return true;
  }
  bool RetractAlongPath(const Eigen::VectorXd&,
                        const Eigen::VectorXd&,
                        Eigen::VectorXd*) const override {
    return false;
  }
  bool Cost(const Eigen::VectorXd& v, double* cost) const override {
    *cost = 50 * std::pow(v[1] - v[0] * v[0], 2) + 0.5 * std::pow(1 - v[0], 2);
    return v[0] >= -2;
  }
  bool Linearize(const Eigen::VectorXd& v) override {
    Eigen::Matrix2d J;
    J << -20 * v[0], 10, -1, 0;
    const Eigen::Vector2d residual(10 * (v[1] - v[0] * v[0]), 1 - v[0]);
    const Eigen::Matrix2d H = J.transpose() * J;
    *equations_.H.Diagonal(0) = H(0, 0);
    *equations_.H.Diagonal(1) = H(1, 1);
    *equations_.H.OffDiagonal(0) = H(0, 1);
    equations_.gradient = J.transpose() * residual;
    return Cost(v, &equations_.cost);
  }
};

TrustRegionOptions OptionsOf(Minimizer minimizer) {
  TrustRegionOptions options;
  options.minimizer = minimizer;
  options.function_tolerance = 1e-16;
  return options;
}

class TrustRegion : public testing::TestWithParam<Minimizer> {};
INSTANTIATE_TEST_SUITE_P(Both,
                         TrustRegion,
                         testing::Values(Minimizer::kLevenbergMarquardt, Minimizer::kDogleg));

TEST_P(TrustRegion, FollowsTheBentValley) {
  Rosenbrock problem;
  Eigen::VectorXd values = Eigen::Vector2d(-1.2, 1);
  const Summary summary = Minimize(OptionsOf(GetParam()), nullptr, &problem, &values);
  EXPECT_TRUE(summary.converged) << summary.message;
  EXPECT_NEAR(values[0], 1, 1e-6);
  EXPECT_NEAR(values[1], 1, 1e-6);
  EXPECT_NEAR(summary.initial_cost, 12.1, 1e-12);
  EXPECT_LT(summary.final_cost, 1e-12);
  EXPECT_LT(summary.iterations, 60);
}

TEST_P(TrustRegion, StopsAtTheLimit) {
  Rosenbrock problem;
  Eigen::VectorXd values = Eigen::Vector2d(-1.2, 1);
  TrustRegionOptions options = OptionsOf(GetParam());
  options.max_iterations = 2;
  const Summary summary = Minimize(options, nullptr, &problem, &values);
  EXPECT_FALSE(summary.converged);
  EXPECT_EQ(summary.iterations, 2);
  EXPECT_LE(summary.final_cost, summary.initial_cost);
}

TEST_P(TrustRegion, AnUndefinedStartIsSaid) {
  Rosenbrock problem;
  Eigen::VectorXd values = Eigen::Vector2d(-3, 1);
  const Summary summary = Minimize(OptionsOf(GetParam()), nullptr, &problem, &values);
  EXPECT_FALSE(summary.converged);
  EXPECT_TRUE(std::isinf(summary.final_cost));
  EXPECT_EQ(values[0], -3);
}

TEST_P(TrustRegion, StopsWhenAsked) {
  Rosenbrock problem;
  Eigen::VectorXd values = Eigen::Vector2d(-1.2, 1);
  int calls = 0;
  const Monitor monitor = [&calls] { return ++calls < 3; };
  EXPECT_THROW(Minimize(OptionsOf(GetParam()), monitor, &problem, &values), Interrupted);
  EXPECT_EQ(calls, 3);
}

TEST_P(TrustRegion, GivesTheSameBitsEachTime) {
  Eigen::VectorXd results[2];
  for (Eigen::VectorXd& values : results) {
    Rosenbrock problem;
    values = Eigen::Vector2d(-1.2, 1);
    Minimize(OptionsOf(GetParam()), nullptr, &problem, &values);
  }
  EXPECT_EQ(results[0], results[1]);
}

/// Poses from the second one on, with all objects, turned by half a radian about the second one.
template <typename Pose>
State Hinged(const State& truth) {
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  State state = truth;
  Eigen::Vector3d hinge(truth.poses(1, 0), truth.poses(1, 1), 0);
  for (Eigen::Index row = 1; row < truth.poses.rows(); ++row) {
    auto pose = state.poses.row(row);
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    position.head<2>() = pose.template head<2>().transpose();
    pose.template head<2>() = (hinge + R * (position - hinge)).template head<2>().transpose();
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      pose[2] += 0.5;
    } else {
      const Eigen::Quaterniond q(Eigen::Vector4d(pose.template tail<4>().transpose()).data());
      pose.template tail<4>() = (Eigen::Quaterniond(R) * q).coeffs().transpose();
    }
  }
  for (Eigen::Index row = 0; row < truth.landmarks.rows(); ++row) {
    Surface<double> surface = EllipsoidModel::Unpack(truth.landmarks.row(row).data());
    surface.center = hinge + R * (surface.center - hinge);
    surface.shape = R * surface.shape * R.transpose();
    state.landmarks.row(row) = EllipsoidFromSurface(surface);
  }
  return state;
}

template <typename Pose>
class HingeOf : public testing::Test {};
using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(HingeOf, PoseTypes);

// One step of odometry is wrong, by 0.5 rad at a sigma of 0.02, and all that hangs from it. To turn
// it back along tangents would stretch the path by an eighth.
TYPED_TEST(HingeOf, TurnsTheWholePathInAStep) {
  const Scene scene = MakeScene<TypeParam>();
  const PreparedGraph prepared(scene.graph, false);
  Stage stage = BatchStage({prepared, {}, {}});
  const auto from_the_first = [&](int row) { return scene.graph.boxes.pose[row] == 0; };
  stage.boxes.erase(std::remove_if(stage.boxes.begin(), stage.boxes.end(), from_the_first),
                    stage.boxes.end());
  State state = Hinged<TypeParam>(scene.truth);
  const SolveOptions options;
  const auto problem = MakeLeastSquares({prepared, options, {}}, stage, state);
  Eigen::VectorXd values = problem->Pack(state);
  const Summary summary = Minimize(OptionsOf(Minimizer::kDogleg), nullptr, problem.get(), &values);
  problem->Unpack(values, &state);
  EXPECT_NEAR(summary.initial_cost, 0.5 * 25 * 25, 1e-3);
  EXPECT_LT(summary.final_cost, 1e-6);
  EXPECT_EQ(summary.rejected_steps, 0);
  EXPECT_LE(summary.iterations, 4);
  EXPECT_LT((state.poses - scene.truth.poses).cwiseAbs().maxCoeff(), 1e-4);
}

template <typename Pose>
class BackendsOf : public testing::Test {};
TYPED_TEST_SUITE(BackendsOf, PoseTypes);

/// Ceres is the second opinion: both reach one optimum from noisy data.
TYPED_TEST(BackendsOf, ReachTheSameOptimum) {
  Scene scene = MakeScene<TypeParam>();
  Random random(11);
  for (int row = 0; row < scene.graph.boxes.size(); ++row) {
    scene.graph.boxes.box.row(row) += random.UniformVector<4>(-1, 1).transpose();
  }
  for (const Loss loss : {Loss::kNone, Loss::kHuber, Loss::kSwitchable}) {
    SolveOptions options;
    options.loss = loss;
    options.function_tolerance = 1e-12;
    const Solution native = Solve(scene.graph, options, {});
    options.backend = Backend::kCeres;
    const Solution ceres = Solve(scene.graph, options, {});
    EXPECT_NEAR(
        native.summary.final_cost, ceres.summary.final_cost, 1e-6 * ceres.summary.final_cost);
    EXPECT_LT((native.poses - ceres.poses).cwiseAbs().maxCoeff(), 1e-4);
  }
}

}  // namespace
}  // namespace dqslam
