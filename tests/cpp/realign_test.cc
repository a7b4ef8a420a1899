#include "dqslam/estimation/realign.h"

#include <gtest/gtest.h>

#include <numeric>

#include "dqslam/estimation/solve.h"
#include "scene.h"

namespace dqslam {
namespace {

template <typename Pose>
class RealignOf : public testing::Test {
 protected:
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Tangent = Eigen::Matrix<double, Pose::kTangentSize, 1>;

  Storage Moved(const Tangent& motion, const RowMatrix& poses, int row) const {
    const Storage origin = Identity();
    Storage by, moved;
    Plus<Pose>(origin.data(), motion.data(), by.data());
    Pose::Compose(by.data(), poses.row(row).data(), moved.data());
    return moved;
  }
  static Storage Identity() {
    Storage pose = Storage::Zero();
    if constexpr (Pose::kModel == PoseModel::kSe3) pose[6] = 1;
    return pose;
  }
  static double ErrorAt(int pose, const RowMatrix& poses, const RowMatrix& truth) {
    Tangent error;
    Minus<Pose>(poses.row(pose).data(), truth.row(pose).data(), error.data());
    return error.norm();
  }

  // The path turns by a constant error at each step between the two poses.
  RowMatrix Drifted(int begin, int end, double turn) const {
    RowMatrix poses = scene_.truth.poses;
    Tangent error = Tangent::Zero();
    error[Pose::kTangentSize - 1] = turn / (end - begin);
    for (int pose = begin + 1; pose < poses.rows(); ++pose) {
      const double* relative = scene_.graph.odometry.relative.row(pose - 1).data();
      Storage step = Eigen::Map<const Storage>(relative);
      if (pose <= end) Plus<Pose>(relative, error.data(), step.data());
      Pose::Compose(poses.row(pose - 1).data(), step.data(), poses.row(pose).data());
    }
    return poses;
  }

  const Scene scene_ = MakeScene<Pose>(60, 2.0);
  const SolveOptions options_{};
  const Monitor monitor_{};
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(RealignOf, PoseTypes);

// A drift of 1 rad over one lap ends in a loop that the boxes of the second lap close.  The
// odometry errs by the same turn at each step, which is also the most likely correction.
TYPED_TEST(RealignOf, TakesTheDriftOutOfTheLoop) {
  Graph graph = this->scene_.graph;
  constexpr int kAnchor = 9, kBegin = 40;
  State state = this->scene_.truth;
  state.poses = this->Drifted(kAnchor, kBegin, 1.0);
  EXPECT_GT(this->ErrorAt(kBegin, state.poses, this->scene_.truth.poses), 1.0);

  // The map has only what the first poses see.
  BoxTable& boxes = graph.boxes;
  std::vector<int> rows;
  for (int row = 0; row < boxes.size(); ++row) {
    if (boxes.pose[row] <= kAnchor || boxes.pose[row] >= kBegin) rows.push_back(row);
  }
  Graph seen = graph;
  seen.boxes.pose = boxes.pose(rows);
  seen.boxes.object = boxes.object(rows);
  seen.boxes.box = boxes.box(rows, Eigen::all);
  seen.boxes.covariance = boxes.covariance(rows, Eigen::all);
  seen.boxes.truncated = boxes.truncated(rows, Eigen::all);
  const PreparedGraph prepared_seen(seen, false);
  const SolveContext context{prepared_seen, this->options_, this->monitor_};
  std::vector<int> known(seen.num_objects());
  std::iota(known.begin(), known.end(), 0);

  const auto realigned = Realign(context, known, kBegin, 50, state);
  ASSERT_TRUE(realigned);
  for (const int pose : {kBegin, 45, 49}) {
    EXPECT_LT(this->ErrorAt(pose, realigned->poses, this->scene_.truth.poses), 0.15) << pose;
  }
  for (const int pose : {15, 25, 35}) {
    EXPECT_LT(this->ErrorAt(pose, realigned->poses, this->scene_.truth.poses),
              0.5 * this->ErrorAt(pose, state.poses, this->scene_.truth.poses))
        << pose;
  }
  EXPECT_EQ(realigned->poses.topRows(kAnchor + 1), state.poses.topRows(kAnchor + 1));
}

// Only a weak link gives way: all other steps are as certain as they can be.
TYPED_TEST(RealignOf, BendsTheWeakLink) {
  Graph graph = this->scene_.graph;
  constexpr int kWeak = 30, k = TypeParam::kTangentSize;
  graph.odometry.covariance.setConstant(0);
  for (int row = 0; row < graph.odometry.size(); ++row) {
    const double sigma = row + 1 == kWeak ? 3.0 : 1e-5;
    const Eigen::MatrixXd covariance = sigma * sigma * Eigen::MatrixXd::Identity(k, k);
    graph.odometry.covariance.row(row) = covariance.reshaped().transpose();
  }
  typename TestFixture::Tangent motion = TestFixture::Tangent::Constant(0.5);
  State state = this->scene_.truth;
  for (int pose = kWeak; pose < graph.num_poses(); ++pose) {
    state.poses.row(pose) = this->Moved(motion, this->scene_.truth.poses, pose).transpose();
  }
  const PreparedGraph prepared(graph, false);
  const SolveContext context{prepared, this->options_, this->monitor_};
  const auto realigned = Realign(context, {0, 1, 2, 3, 4}, kWeak, 50, state);
  ASSERT_TRUE(realigned);
  EXPECT_LT((realigned->poses.topRows(kWeak) - state.poses.topRows(kWeak)).norm(), 1e-6);
  EXPECT_LT(this->ErrorAt(kWeak, realigned->poses, this->scene_.truth.poses), 0.15);
  EXPECT_LT(this->ErrorAt(49, realigned->poses, this->scene_.truth.poses), 0.3);
}

TYPED_TEST(RealignOf, NeedsObjectsThatAgree) {
  const Graph& graph = this->scene_.graph;
  const PreparedGraph prepared(graph, false);
  const SolveContext context{prepared, this->options_, this->monitor_};
  EXPECT_FALSE(Realign(context, {2}, 30, 50, this->scene_.truth));
  EXPECT_FALSE(Realign(context, {}, 30, 50, this->scene_.truth));
  State scattered = this->scene_.truth;  // The map has the objects meters from each other.
  for (int object = 0; object < graph.num_objects(); ++object) {
    scattered.landmarks(object, 0) += 30 * object * object;
  }
  EXPECT_FALSE(Realign(context, {0, 1, 2, 3, 4}, 30, 50, scattered));
}

// Ten seconds without odometry: the two halves of the path know nothing of each other but objects.
TYPED_TEST(RealignOf, SolveCrossesAWeakLink) {
  Graph graph = this->scene_.graph;
  constexpr int kWeak = 30, k = TypeParam::kTangentSize;
  typename TestFixture::Tangent error = TestFixture::Tangent::Constant(1.5);
  typename TestFixture::Storage step;
  Plus<TypeParam>(graph.odometry.relative.row(kWeak - 1).data(), error.data(), step.data());
  graph.odometry.relative.row(kWeak - 1) = step.transpose();
  const Eigen::MatrixXd wide = 4.0 * Eigen::MatrixXd::Identity(k, k);
  graph.odometry.covariance.row(kWeak - 1) = wide.reshaped().transpose();
  const Solution solution = Solve(graph, SolveOptions(), {});
  EXPECT_TRUE(solution.summary.converged) << ToString(solution.summary);
  EXPECT_LT(this->ErrorAt(59, solution.poses, this->scene_.truth.poses), 0.05)
      << ToString(solution.summary);
}

}  // namespace
}  // namespace dqslam
