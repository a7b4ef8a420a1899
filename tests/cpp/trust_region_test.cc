#include "dqslam/trust_region.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dqslam/recover.h"
#include "dqslam/solve.h"
#include "scene.h"

namespace dqslam {
namespace {

/// Rosenbrock's valley as residuals (10 (y - x^2), 1 - x), undefined for x < -2.
class Rosenbrock : public LeastSquares {
 public:
  Rosenbrock() : LeastSquares(BlockMatrix({1, 1}, {{0, 1}})) {}
  Eigen::VectorXd Pack(const State&) const override { return {}; }
  void Unpack(const Eigen::VectorXd&, State*) const override {}
  bool Plus(const Eigen::VectorXd& values,
            const Eigen::VectorXd& step,
            Eigen::VectorXd* moved) const override {
    *moved = values + step;
    return true;
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

template <typename Pose>
class BackendsOf : public testing::Test {};
using PoseTypes = testing::Types<Se2, Se3>;
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
