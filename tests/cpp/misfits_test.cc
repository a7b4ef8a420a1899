#include "dqslam/estimation/misfits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/pair_starts.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/estimation/solve.h"
#include "scene.h"

namespace dqslam {
namespace {

constexpr int kPose = 9;

// A scene with what the functions under test take.
struct Problem {
  explicit Problem(Scene of) : scene(std::move(of)), prepared(scene.graph, false) {}

  std::vector<PoseRun> Misplaced(const State& state) const {
    return MisplacedPoses({prepared, options, monitor}, state);
  }
  // Restarts the misfits of a state as a solve does.
  void Restart(State* state) const {
    const SolveContext context{prepared, options, monitor};
    Stage last = InlierStage(context, *state);
    Summary summary = Optimize(context, last, state);
    RestartMisfits(context, &last, state, &summary);
  }

  Scene scene;
  PreparedGraph prepared;
  SolveOptions options;
  Monitor monitor;
};

void MoveBoxes(int pose, Graph* graph) {
  for (int row = 0; row < graph->boxes.size(); ++row) {
    if (graph->boxes.pose[row] == pose) graph->boxes.box.row(row).array() += 50;
  }
}

TEST(MisplacedPoses, FitNeitherOdometryNorBoxes) {
  const Problem exact(MakeScene<Se2>());
  EXPECT_TRUE(exact.Misplaced(exact.scene.truth).empty());
  State turned = exact.scene.truth;
  turned.poses(kPose, 2) += 3;
  const std::vector<PoseRun> runs = exact.Misplaced(turned);
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(runs[0].first, kPose);
  EXPECT_EQ(runs[0].last, kPose);
}

TEST(MisplacedPoses, NotByWrongBoxesOrOdometryAlone) {
  Scene wrong = MakeScene<Se2>();
  MoveBoxes(kPose, &wrong.graph);
  EXPECT_TRUE(Problem(wrong).Misplaced(wrong.truth).empty());
  Scene slip = MakeScene<Se2>();
  slip.graph.odometry.relative(kPose, 0) += 1;  // 50 sigmas
  EXPECT_TRUE(Problem(slip).Misplaced(slip.truth).empty());
  MoveBoxes(kPose, &slip.graph);
  EXPECT_EQ(Problem(slip).Misplaced(slip.truth).size(), 1u) << "both";
}

// All steps are off by 5 of their sigmas: the odometry is worse than it says, everywhere.
TEST(MisplacedPoses, AreJudgedByTheOtherSteps) {
  Scene noisy = MakeScene<Se2>();
  noisy.graph.odometry.relative.col(0).array() += 0.1;
  MoveBoxes(kPose, &noisy.graph);
  EXPECT_TRUE(Problem(noisy).Misplaced(noisy.truth).empty());
}

// Odometry that is 0.2 rad off on either side of a pose, well within its sigma of 0.5, has two
// minima: the right heading and, since a heading ends at a half turn, the opposite one.
TEST(RestartMisfits, TurnsAPoseBack) {
  Scene scene = MakeScene<Se2>();
  scene.graph.odometry.covariance.middleRows<2>(kPose - 1) *= 625;
  scene.graph.odometry.relative(kPose - 1, 2) += 0.2;
  scene.graph.odometry.relative(kPose, 2) += 0.2;
  const Problem problem(scene);
  State turned = scene.truth;
  turned.poses(kPose, 2) += M_PI;
  const SolveContext context{problem.prepared, problem.options, problem.monitor};
  Optimize(context, InlierStage(context, turned), &turned);
  EXPECT_NEAR(turned.poses(kPose, 2) - scene.truth.poses(kPose, 2), M_PI, 0.5) << "a minimum";
  problem.Restart(&turned);
  EXPECT_LT((turned.poses - scene.truth.poses).cwiseAbs().maxCoeff(), 0.01);
}

// At the end of the path, the odometry of two uncertain steps leads away from the boxes.
TEST(RestartMisfits, AdmitsTheLastBoxes) {
  Scene scene = MakeScene<Se2>();
  const int count = scene.graph.num_poses();
  scene.graph.odometry.covariance.bottomRows<2>() *= 100;
  scene.graph.odometry.relative(count - 3, 2) += 0.15;  // less than one sigma of 0.2
  const Problem problem(scene);
  const SolveContext context{problem.prepared, problem.options, problem.monitor};
  State bent = scene.truth;
  DeadReckon(problem.prepared, count - 2, count, &bent);
  const Stage last = InlierStage(context, bent);
  for (int row = 0; row < scene.graph.boxes.size(); ++row) {
    ASSERT_EQ(last.weights[row] > 0, scene.graph.boxes.pose[row] < count - 2);
  }
  Optimize(context, last, &bent);
  EXPECT_NEAR(bent.poses(count - 1, 2) - scene.truth.poses(count - 1, 2), 0.15, 0.01);
  problem.Restart(&bent);
  EXPECT_LT((bent.poses - scene.truth.poses).cwiseAbs().maxCoeff(), 0.01);
}

// Of the boxes of an object, three quarters show the other objects in turn.
Scene MostlyOthers(std::vector<int>* right) {
  Scene scene = MakeScene<Se2>();
  BoxTable& boxes = scene.graph.boxes;
  int turn = 0;
  for (int row = 0; row < boxes.size(); ++row) {
    if (boxes.object[row] != 2) continue;
    if (turn % 4 == 0) right->push_back(row);
    const int other = turn % 4 == 0 ? -1 : turn % 3 + (turn % 3 >= 2);
    for (int shown = 0; other >= 0 && shown < boxes.size(); ++shown) {
      if (boxes.object[shown] == other && boxes.pose[shown] == boxes.pose[row]) {
        boxes.box.row(row) = boxes.box.row(shown);
      }
    }
    ++turn;
  }
  return scene;
}

TEST(StartsFromPairs, FindTheObjectAmongOthers) {
  std::vector<int> right;
  const Problem problem(MostlyOthers(&right));
  ASSERT_GE(right.size(), 4u);
  const std::vector<Vector9d> starts =
      StartsFromPairs({problem.prepared, problem.options, problem.monitor}, problem.scene.truth, 2);
  ASSERT_GE(starts.size(), 2u);
  const Eigen::Vector3d center = problem.scene.truth.landmarks.row(2).head<3>();
  double nearest = 10;
  for (const Vector9d& start : starts) {
    nearest = std::min(nearest, (start.head<3>() - center).norm());
  }
  EXPECT_LT(nearest, 0.3);
  for (size_t i = 1; i < starts.size(); ++i) {
    EXPECT_GT((starts[i] - starts[0]).head<3>().norm(), 0.1) << "the same place twice";
  }
}

TEST(StartsFromPairs, NoneWithoutPairs) {
  Scene scene = MakeScene<Se2>();
  bool is_first = true;
  for (int row = 0; row < scene.graph.boxes.size(); ++row) {
    if (scene.graph.boxes.object[row] != 2) continue;
    if (!is_first) scene.graph.boxes.object[row] = 1;
    is_first = false;
  }
  const Problem problem(scene);
  EXPECT_TRUE(StartsFromPairs({problem.prepared, problem.options, problem.monitor}, scene.truth, 2)
                  .empty());
}

}  // namespace
}  // namespace dqslam
