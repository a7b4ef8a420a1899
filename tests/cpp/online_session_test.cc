#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "session_scene.h"

namespace dqslam::online {
namespace {

using Poses = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(SessionTest, Poses);

TYPED_TEST(SessionTest, PositionsKeepTheirObject) {
  const auto session = this->Begin();
  this->Add(session.get(), 0, kNone, kAll);
  StepObservations observations;
  observations.box.resize(0, 4);
  observations.measurements = {{"position",
                                IndexVector(),
                                IndexVector::Zero(1),
                                RowMatrix::Constant(1, 3, 1),
                                Eigen::Matrix3d::Identity().reshaped().transpose()}};
  constexpr int k = TypeParam::kTangentSize;
  const Eigen::VectorXd step = this->scene_.graph.odometry.relative.row(0);
  const int row = session->Add(step, RowMatrix::Identity(k, k), observations).first_observation;
  EXPECT_THROW(session->Relabel(this->Labels({row}, -1)), std::invalid_argument);
  observations.measurements[0].object[0] = -1;
  EXPECT_THROW(session->Add(step, RowMatrix::Identity(k, k), observations), std::invalid_argument);
  EXPECT_EQ(session->num_poses(), 2);
}

// The objects are out of sight for half of the drive, and only later told to be the same.
TYPED_TEST(SessionTest, ALoopThatIsToldLateIsClosed) {
  for (const double drift : {0.0, 0.02}) {
    this->scene_ = MakeScene<TypeParam>();
    for (auto row : this->scene_.graph.odometry.relative.rowwise()) row[1] += drift;
    OnlineOptions options;
    options.loop_absence = 15;
    auto session = this->Begin(options);
    std::vector<int> late;
    int observations = 0, closed = 0, smoothed = 0;
    for (int pose = 0; pose < 40; ++pose) {
      const auto given = [&](int row) { return this->PoseOf(row) < 10 || this->PoseOf(row) >= 30; };
      const auto waits = [&](int row) { return this->PoseOf(row) >= 30; };
      const StepReport report = this->Add(session.get(), pose, waits, given);
      closed += report.closed_loop;
      if (report.closed_loop) smoothed = report.smoothed_poses;
      for (int row = 0; row < this->boxes(); ++row) {
        if (this->PoseOf(row) != pose || !given(row)) continue;
        if (waits(row) && pose < 35 && this->row_[this->ObjectOf(row)] >= 0)
          late.push_back(observations);
        ++observations;
      }
      if (pose == 34) {
        EXPECT_EQ(closed, 0);
        NewLabels labels = this->Labels(late, -1);
        int i = 0;
        for (int row = 0; row < this->boxes(); ++row) {
          const int own = this->row_[this->ObjectOf(row)];
          if (given(row) && waits(row) && this->PoseOf(row) < 35 && own >= 0) {
            labels.object[i++] = own;
          }
        }
        session->Relabel(labels);
      }
    }
    // Where there is no drift all fits, and nothing is to be done.
    EXPECT_EQ(closed, drift > 0 ? 1 : 0);
    EXPECT_GE(smoothed, drift > 0 ? 25 : 0);
  }
}

TYPED_TEST(SessionTest, ScalesTheStepsButNotTheFirstPose) {
  constexpr int k = TypeParam::kTangentSize, translations = k - k / 2;
  const auto scaled = this->Fed(kNone);
  scaled->ScaleOdometry(2, 3);
  Eigen::Matrix<double, k, 1> factor;
  factor.setConstant(2);
  factor.template tail<k / 2>().setConstant(3);
  ASSERT_EQ(factor[translations - 1], 2);
  ASSERT_EQ(factor[translations], 3);
  std::vector<int> unused;
  const RowMatrix covariance = scaled->ToGraph(&unused).odometry.covariance;
  for (auto row : this->scene_.graph.odometry.covariance.rowwise()) {
    row.array() *= (factor * factor.transpose()).reshaped().transpose().array();
  }
  EXPECT_LT((covariance - this->scene_.graph.odometry.covariance).norm(), 1e-15);
  // As if they had been given so.
  const auto given = this->Fed(kNone);
  const double cost = this->Converge(given.get());
  EXPECT_NEAR(this->Converge(scaled.get()), cost, 1e-7 * cost);
  EXPECT_LT((scaled->Poses() - given->Poses()).cwiseAbs().maxCoeff(), 1e-6);
  for (const double bad : {0.0,
                           -1.0,
                           std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(scaled->ScaleOdometry(bad, 1), std::invalid_argument);
    EXPECT_THROW(scaled->ScaleOdometry(1, bad), std::invalid_argument);
  }
  EXPECT_EQ(scaled->ToGraph(&unused).odometry.covariance, covariance);
}

TYPED_TEST(SessionTest, SmoothsFromAPoseOn) {
  const auto session = this->Fed(kNone);
  const RowMatrix before = session->Poses();
  session->Smooth(10, 25);
  EXPECT_EQ(session->Poses().topRows(25), before.topRows(25));
  EXPECT_GT((session->Poses() - before).bottomRows(15).norm(), 1e-6);
  EXPECT_EQ(session->Smooth(10, 40), 0);
  EXPECT_THROW(session->Smooth(10, 41), std::invalid_argument);
  EXPECT_THROW(session->Smooth(10, -1), std::invalid_argument);
}

TYPED_TEST(SessionTest, PosesAtSomeRows) {
  const auto session = this->Fed(kNone);
  const RowMatrix all = session->Poses(), some = session->PosesAt(Eigen::Vector3i(39, 0, 7));
  ASSERT_EQ(some.rows(), 3);
  EXPECT_EQ(some.row(0), all.row(39));
  EXPECT_EQ(some.row(1), all.row(0));
  EXPECT_EQ(some.row(2), all.row(7));
  EXPECT_EQ(session->PosesAt(IndexVector()).rows(), 0);
  EXPECT_THROW(session->PosesAt(Eigen::Vector2i(0, 40)), std::out_of_range);
  EXPECT_THROW(session->PosesAt(Eigen::Vector2i(-1, 0)), std::out_of_range);
}

// What is older than the longest smoothing is not linearized again: the twelfth lap takes no more
// work than the fifth, though all laps see the same objects.
TYPED_TEST(SessionTest, TheWorkOfAStepDoesNotGrow) {
  constexpr int kLap = 30;
  this->scene_ = MakeScene<TypeParam>(12 * kLap, 12.0);
  this->Disturb(1, 0.01);
  OnlineOptions options;
  options.short_smoothing = {15, 5, 2};
  options.medium_smoothing = {25, 10, 2};
  options.long_smoothing = {40, 30, 1};
  auto session = this->Begin(options);
  std::vector<int> most(12, 0);
  for (int pose = 0; pose < 12 * kLap; ++pose) {
    const StepReport report = this->Add(session.get(), pose, kNone, kAll);
    int& work = most[pose / kLap];
    work = std::max(work, report.linearized + report.smoothed_observations);
  }
  EXPECT_GT(most[4], 0);
  EXPECT_LE(*std::max_element(most.begin() + 5, most.end()), 1.5 * std::max(most[3], most[4]));
}

}  // namespace
}  // namespace dqslam::online
