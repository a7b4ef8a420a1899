#include "dqslam/estimation/graduated.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cost_checks.h"
#include "dqslam/costs/box.h"
#include "dqslam/costs/switched.h"
#include "dqslam/estimation/solve.h"
#include "dqslam/solver/loss.h"
#include "scene.h"

namespace dqslam {
namespace {

TEST(DcsLoss, ByHandAndContinuous) {
  const DcsLoss loss(2);
  double rho[3];
  loss.Evaluate(1, rho);
  EXPECT_DOUBLE_EQ(rho[0], 1);
  EXPECT_DOUBLE_EQ(rho[1], 1);
  loss.Evaluate(6, rho);  // scale 2 * 2 / (2 + 6) = 1/2
  EXPECT_DOUBLE_EQ(rho[0], 3 * 2 - 16.0 / 8);
  EXPECT_DOUBLE_EQ(rho[1], 0.25);
  loss.Evaluate(std::nextafter(2, 3), rho);
  EXPECT_NEAR(rho[0], 2, 1e-12);
  EXPECT_NEAR(rho[1], 1, 1e-12);
}

TEST(DcsLoss, DerivativesMatchDifferences) {
  const DcsLoss loss(13.28);
  for (const double s : {5.0, 14.0, 60.0, 1000.0}) {
    constexpr double kStep = 1e-4;
    double rho[3], above[3], below[3];
    loss.Evaluate(s, rho);
    loss.Evaluate(s + kStep, above);
    loss.Evaluate(s - kStep, below);
    EXPECT_NEAR(rho[1], (above[0] - below[0]) / (2 * kStep), 1e-7);
    EXPECT_NEAR(rho[2], (above[1] - below[1]) / (2 * kStep), 1e-7);
  }
}

// At the best switch w = phi / (phi + s), the cost is phi s / (phi + s).
TEST(SwitchedCost, MinimizesToGemanMcClure) {
  const Scene scene = MakeScene<Se2>();
  constexpr double kPhi = 13.28;
  using Box = BoxCost<Se2, EllipsoidModel>;
  const Eigen::Vector4d observed =
      scene.graph.boxes.box.row(0).transpose() + Eigen::Vector4d(3, -2, 4, 1);
  const Box box{
      {}, scene.graph.camera, Mount(scene.graph.camera), observed, Eigen::Matrix4d::Identity()};
  const CostPointer cost(SwitchedCost<Se2, Box>::Create(box, std::sqrt(kPhi)));
  const double s = 9 + 4 + 16 + 1;
  const Eigen::Vector3d pose = scene.truth.poses.row(scene.graph.boxes.pose[0]);
  const Vector9d landmark = scene.truth.landmarks.row(scene.graph.boxes.object[0]);
  const Block switch_block{Eigen::VectorXd::Constant(1, kPhi / (kPhi + s)),
                           std::make_shared<ceres::EuclideanManifold<1>>()};
  const std::vector<Block> blocks = {PoseBlock<Se2>(pose), LandmarkBlock(landmark), switch_block};
  EXPECT_NEAR(ResidualOf(*cost, blocks).squaredNorm(), kPhi * s / (kPhi + s), 1e-4);
  ExpectJacobiansMatchPerturbation(*cost, blocks);
}

// Shifts an edge of some boxes, so that each has this chi-square at the truth.
void Shift(int boxes, double chi_square, Graph* graph) {
  for (int row = 0; row < boxes; ++row) {
    graph->boxes.box(row, 2) += std::sqrt(chi_square * graph->boxes.covariance(row, 10));
  }
}

TEST(NearlyAllFit, UnlessBoxesAreFarOrMany) {
  const SolveOptions options;
  const double threshold = options.outlier_chi_square;
  const auto fit = [&](const Scene& scene) {
    const PreparedGraph prepared(scene.graph, false);
    const Monitor monitor;
    return NearlyAllFit({prepared, options, monitor}, scene.truth);
  };
  const Scene exact = MakeScene<Se2>();
  const int few = exact.graph.boxes.size() / 100;
  ASSERT_GE(few, 1);
  EXPECT_TRUE(fit(exact));
  Scene near = exact, far = exact, many = exact;
  Shift(few, 2 * threshold, &near.graph);
  EXPECT_TRUE(fit(near));
  Shift(few, 11 * threshold, &far.graph);
  EXPECT_FALSE(fit(far));
  Shift(few + 1, 2 * threshold, &many.graph);
  EXPECT_FALSE(fit(many));
}

// A tenth of the boxes go to the next object; exact measurements otherwise.
TEST(RobustSolve, FindsTheTruthAndTheWrongBoxes) {
  Scene scene = MakeScene<Se3>();
  BoxTable& boxes = scene.graph.boxes;
  std::vector<bool> wrong(boxes.size(), false);
  for (int row = 7; row < boxes.size(); row += 10) {
    boxes.object[row] = (boxes.object[row] + 1) % scene.graph.num_objects();
    wrong[row] = true;
  }
  for (const Loss loss :
       {Loss::kCauchy, Loss::kDcs, Loss::kSwitchable, Loss::kGncTls, Loss::kGncGm}) {
    SolveOptions options;
    options.loss = loss;
    const Solution solution = Solve(scene.graph, options, {});
    const double largest = (solution.poses - scene.truth.poses).leftCols<3>().cwiseAbs().maxCoeff();
    EXPECT_LT(largest, 0.02) << "loss " << static_cast<int>(loss);  // Cauchy keeps a small pull
    int mistaken = 0;
    for (int row = 0; row < boxes.size(); ++row) mistaken += solution.inliers[row] == wrong[row];
    EXPECT_LE(mistaken, 1) << "loss " << static_cast<int>(loss);
  }
  const Solution by_default = Solve(scene.graph, SolveOptions(), {});
  EXPECT_LT((by_default.poses - scene.truth.poses).leftCols<3>().cwiseAbs().maxCoeff(), 1e-3);
  SolveOptions options;
  options.loss = Loss::kNone;
  const Solution plain = Solve(scene.graph, options, {});
  EXPECT_FALSE(plain.summary.converged) << "a tenth of the boxes do not fit";
  EXPECT_THAT(plain.summary.message, testing::HasSubstr("% of the boxes do not fit"));
  EXPECT_GT((plain.poses - scene.truth.poses).leftCols<3>().cwiseAbs().maxCoeff(), 0.05);
}

}  // namespace
}  // namespace dqslam
