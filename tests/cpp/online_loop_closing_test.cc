#include "dqslam/online/loop_closing.h"
#include "session_scene.h"

namespace dqslam::online {
namespace {

constexpr int kAbsent = 10, kBack = 40;

// Two laps, of which the boxes show the beginning and the end.  The steps between err by a turn
// that their covariance admits.
template <typename Pose>
class LoopClosingTest : public SessionTest<Pose> {
 public:
  static constexpr int k = Pose::kTangentSize;

  void Drift(double turn, double sigma) {
    this->scene_ = MakeScene<Pose>(60, 2.0);
    Eigen::Matrix<double, k, 1> error = Eigen::Matrix<double, k, 1>::Zero();
    error[k - 1] = turn / (kBack - kAbsent);
    OdometryTable& odometry = this->scene_.graph.odometry;
    for (int step = kAbsent; step < kBack; ++step) {
      Eigen::Matrix<double, Pose::kSize, 1> relative;
      Plus<Pose>(odometry.relative.row(step).data(), error.data(), relative.data());
      odometry.relative.row(step) = relative.transpose();
      odometry.covariance.row(step) *= sigma * sigma;
    }
  }

  static OnlineOptions Options() {
    OnlineOptions options;
    options.loop_absence = 15;
    return options;
  }

  bool IsGiven(int row) const { return this->PoseOf(row) < kAbsent || this->PoseOf(row) >= kBack; }

  double ErrorAt(const Session& session, int pose) const {
    const Eigen::VectorXd found = session.PoseAt(pose);
    Eigen::Matrix<double, k, 1> error;
    Minus<Pose>(found.data(), this->scene_.truth.poses.row(pose).data(), error.data());
    return error.norm();
  }
};

using Poses = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(LoopClosingTest, Poses);

// Boxes alone do not lead back from a drift of meters.
TYPED_TEST(LoopClosingTest, ObjectsThatAgreeEndALargeDrift) {
  this->Drift(1.5, 40);
  auto session = this->Begin(this->Options());
  int closed = -1;
  for (int pose = 0; pose < 60; ++pose) {
    const StepReport report = this->Add(
        session.get(),
        pose,
        [](int) { return false; },
        [&](int row) { return this->IsGiven(row); });
    if (report.closed_loop && closed < 0) closed = pose;
    if (pose == kBack - 1) {
      EXPECT_GT(this->ErrorAt(*session, pose), 1);
    }
  }
  EXPECT_GE(closed, kBack);
  EXPECT_LE(closed, kBack + 5);
  for (int pose = kBack; pose < 60; ++pose) EXPECT_LT(this->ErrorAt(*session, pose), 0.05);
  // Each box counts, those too that waited.
  int given = 0;
  for (int row = 0; row < this->boxes(); ++row) given += this->IsGiven(row);
  EXPECT_EQ(session->Observations().sum(), given);
}

// Where the objects contradict each other, the loop stays open: what was known keeps its place, and
// the poses are those of the odometry.
TYPED_TEST(LoopClosingTest, ObjectsThatContradictLeaveItOpen) {
  this->Drift(1.5, 40);
  BoxTable& boxes = this->scene_.graph.boxes;
  const IndexVector objects = boxes.object;
  for (int row = 0; row < boxes.size(); ++row) {
    if (this->PoseOf(row) >= kBack) boxes.object[row] = (objects[row] * 3 + 1) % 5;
  }
  auto session = this->Begin(this->Options());
  RowMatrix known;
  for (int pose = 0; pose < 60; ++pose) {
    const StepReport report = this->Add(
        session.get(),
        pose,
        [](int) { return false; },
        [&](int row) { return this->IsGiven(row); });
    if (pose == kBack - 1) known = session->Ellipsoids();
    EXPECT_FALSE(report.closed_loop) << pose;
  }
  const Eigen::Index seen = known.rows();
  EXPECT_LT((session->Ellipsoids().topRows(seen) - known).cwiseAbs().maxCoeff(), 1e-3);
}

// A copy goes on as its original does, in the middle of an open loop as well.
TYPED_TEST(LoopClosingTest, ACopyGoesOnAlike) {
  this->Drift(1.5, 40);
  auto session = this->Begin(this->Options());
  std::unique_ptr<Session> copy;
  const auto given = [&](int row) { return this->IsGiven(row); };
  for (int pose = 0; pose < 60; ++pose) {
    const auto rows = this->row_;
    if (copy) {
      this->Add(copy.get(), pose, [](int) { return false; }, given);
      this->row_ = rows;
    }
    this->Add(session.get(), pose, [](int) { return false; }, given);
    if (pose == kBack) copy = session->Clone();
  }
  EXPECT_EQ(session->Poses(), copy->Poses());
  EXPECT_EQ(session->Ellipsoids(), copy->Ellipsoids());
}

}  // namespace
}  // namespace dqslam::online
