// The same bits with any number of threads, and the right ones.
#include <gtest/gtest.h>

#include <numeric>

#include "block_patterns.h"
#include "dqslam/estimation/solve.h"
#include "dqslam/linear/block_cholesky.h"
#include "dqslam/linear/subtrees.h"
#include "dqslam/solver/least_squares.h"
#include "dqslam/solver/term_chunks.h"
#include "scene.h"

namespace dqslam {
namespace {

constexpr int kCopies = 40;

// A scene off its truth, in which each box occurs so often that a stage has several chunks.  The
// copies are one after the other, so that the boxes are not in the order of poses.
template <typename Pose>
Scene LargeScene() {
  Scene scene = MakeScene<Pose>();
  BoxTable& boxes = scene.graph.boxes;
  boxes.pose = IndexVector(boxes.pose.replicate(kCopies, 1));
  boxes.object = IndexVector(boxes.object.replicate(kCopies, 1));
  boxes.box = RowMatrix(boxes.box.replicate(kCopies, 1));
  boxes.covariance = RowMatrix(boxes.covariance.replicate(kCopies, 1));
  boxes.truncated = BoolTable(boxes.truncated.replicate(kCopies, 1));
  scene.truth.landmarks.leftCols<3>().array() += 0.02;
  return scene;
}

Stage AllBoxes(const Graph& graph, double weight) {
  Stage stage;
  stage.end_pose = graph.num_poses();
  stage.boxes.resize(graph.boxes.size());
  std::iota(stage.boxes.begin(), stage.boxes.end(), 0);
  stage.weights.assign(stage.boxes.size(), weight);
  stage.residual = Residual::kBox;
  return stage;
}

NormalEquations Linearized(const Scene& scene, double weight, int threads) {
  const PreparedGraph prepared(scene.graph, false);
  SolveOptions options;
  options.threads = threads;
  const auto problem =
      MakeLeastSquares({prepared, options, {}}, AllBoxes(scene.graph, weight), scene.truth);
  const Eigen::VectorXd values = problem->Pack(scene.truth);
  double cost = 0;
  EXPECT_TRUE(problem->Cost(values, &cost));
  EXPECT_TRUE(problem->Linearize(values));
  EXPECT_EQ(cost, problem->equations().cost);
  return problem->equations();
}

template <typename Pose>
class ThreadsOf : public testing::Test {};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(ThreadsOf, PoseTypes);

TYPED_TEST(ThreadsOf, ChunksHaveEachTermOnceInTheOrderOfPoses) {
  const Scene scene = LargeScene<TypeParam>();
  const PreparedGraph prepared(scene.graph, false);
  const SolveOptions options;
  StageTerms terms = SelectTerms({prepared, options, {}}, AllBoxes(scene.graph, 1), scene.truth);
  const std::vector<TermChunk> chunks = SplitTerms(scene.graph, &terms);
  ASSERT_GT(chunks.size(), 1u);
  TermChunk end{0, 0, {0, 0}, {0, 0}};
  for (const TermChunk& chunk : chunks) {
    EXPECT_EQ(chunk.first_pose, end.end_pose);
    EXPECT_EQ(chunk.odometry.begin, end.odometry.end);
    EXPECT_EQ(chunk.boxes.begin, end.boxes.end);
    for (size_t i = chunk.boxes.begin; i < chunk.boxes.end; ++i) {
      const int pose = scene.graph.boxes.pose[terms.boxes[i].row];
      EXPECT_TRUE(chunk.first_pose <= pose && pose < chunk.end_pose);
    }
    for (size_t i = chunk.odometry.begin; i < chunk.odometry.end; ++i) {
      const int later = scene.graph.odometry.to[terms.odometry[i]];
      EXPECT_TRUE(chunk.first_pose <= later && later < chunk.end_pose);
    }
    end = chunk;
  }
  EXPECT_EQ(end.end_pose, scene.graph.num_poses());
  EXPECT_EQ(end.odometry.end, static_cast<size_t>(scene.graph.odometry.size()));
  EXPECT_EQ(end.boxes.end, static_cast<size_t>(scene.graph.boxes.size()));
}

// Copies that share the weight of a box add up to the box.
TYPED_TEST(ThreadsOf, EquationsAreThoseOfEachBoxOnce) {
  Scene once = MakeScene<TypeParam>();
  once.truth.landmarks = LargeScene<TypeParam>().truth.landmarks;
  const NormalEquations expected = Linearized(once, 1, 1);
  const NormalEquations found = Linearized(LargeScene<TypeParam>(), 1.0 / kCopies, 2);
  EXPECT_NEAR(found.cost, expected.cost, 1e-10 * expected.cost);
  EXPECT_LT((found.gradient - expected.gradient).norm(), 1e-10 * expected.gradient.norm());
  const Eigen::MatrixXd H = Dense(expected.H);
  EXPECT_LT((Dense(found.H) - H).norm(), 1e-10 * H.norm());
}

TYPED_TEST(ThreadsOf, EquationsHaveTheSameBits) {
  const Scene scene = LargeScene<TypeParam>();
  const NormalEquations one = Linearized(scene, 1, 1);
  for (const int threads : {2, 3}) {
    const NormalEquations several = Linearized(scene, 1, threads);
    EXPECT_EQ(several.cost, one.cost);
    EXPECT_EQ(several.gradient, one.gradient);
    EXPECT_EQ(Dense(several.H), Dense(one.H));
  }
}

TYPED_TEST(ThreadsOf, SolutionsHaveTheSameBits) {
  for (const Scene& scene : {MakeScene<TypeParam>(), LargeScene<TypeParam>()}) {
    SolveOptions options;
    const Solution one = Solve(scene.graph, options, {});
    for (const int threads : {2, 3}) {
      options.threads = threads;
      const Solution several = Solve(scene.graph, options, {});
      EXPECT_EQ(several.poses, one.poses);
      EXPECT_EQ(several.landmarks, one.landmarks);
      EXPECT_EQ(several.summary.final_cost, one.summary.final_cost);
    }
  }
}

//        8          A sixteenth of the cost is 4.25.
//    6       7
//  2   5
// 0 1 3 4
TEST(SplitTree, TakesTheLargestSubtreesThatFit) {
  const std::vector<int> parent{2, 2, 6, 5, 5, 6, 8, 8, -1};
  const double kCost = 1e7;
  std::vector<double> cost(9, kCost);
  cost[8] = 60 * kCost;
  const std::vector<Subtree> subtrees = SplitTree(parent, cost);
  ASSERT_EQ(subtrees.size(), 3u);
  EXPECT_EQ(subtrees[0].begin, 0);
  EXPECT_EQ(subtrees[0].end, 3);
  EXPECT_EQ(subtrees[1].begin, 3);
  EXPECT_EQ(subtrees[1].end, 6);
  EXPECT_EQ(subtrees[2].begin, 7);
  EXPECT_EQ(subtrees[2].end, 8);
}

TEST(SplitTree, LeavesASmallTreeWhole) {
  EXPECT_TRUE(SplitTree({1, 2, -1}, {1, 1, 1}).empty());
  EXPECT_TRUE(SplitTree({}, {}).empty());
}

TEST(BlockCholesky, HasTheSameBitsWithAnyNumberOfThreads) {
  Random random(5);
  const Pattern pattern = MeetingDrives(40, 500);
  BlockMatrix A(pattern.sizes, pattern.pairs);
  FillPositiveDefinite(pattern, random, A);
  ASSERT_GE(Elimination(*A.pattern()).subtrees.size(), 30u);
  const Eigen::VectorXd b = RandomVector(A.rows(), random);
  const Eigen::VectorXd damping = Eigen::VectorXd::Zero(A.rows());
  BlockCholesky one(A);
  ASSERT_TRUE(one.Factorize(A, damping));
  const Eigen::VectorXd expected = one.Solve(b);
  EXPECT_LT((A.Multiply(expected) - b).norm(), 1e-9 * b.norm());
  for (const int threads : {2, 3}) {
    BlockCholesky several(A, threads);
    for (int repeat = 0; repeat < 2; ++repeat) {
      ASSERT_TRUE(several.Factorize(A, damping));
      EXPECT_EQ(several.Solve(b), expected);
    }
    BlockMatrix indefinite = A;
    indefinite.Diagonal(0)[0] = -1;
    EXPECT_FALSE(several.Factorize(indefinite, damping));
  }
}

}  // namespace
}  // namespace dqslam
