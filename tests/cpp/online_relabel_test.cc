#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "session_scene.h"

namespace dqslam::online {
namespace {

using Poses = testing::Types<Se2, Se3>;
template <typename Pose>
using RelabelTest = SessionTest<Pose>;
TYPED_TEST_SUITE(RelabelTest, Poses);

TYPED_TEST(RelabelTest, BoxesThatWaitTakeNoPart) {
  const auto waits = [](int row) { return row % 3 == 0; };
  auto without = this->Begin(), with = this->Begin();
  const std::vector<int> nothing = this->row_;
  std::vector<int> rows = nothing;
  int first_observation = 0;
  for (int pose = 0; pose < this->scene_.truth.poses.rows(); ++pose) {
    this->row_ = rows;
    this->Add(without.get(), pose, kNone, [&](int row) { return !waits(row); });
    this->row_ = rows;
    EXPECT_EQ(this->Add(with.get(), pose, waits, kAll).first_observation, first_observation);
    rows = this->row_;
    for (int row = 0; row < this->boxes(); ++row) first_observation += this->PoseOf(row) == pose;
    ASSERT_EQ(with->Poses(), without->Poses()) << pose;
    ASSERT_EQ(with->Ellipsoids(), without->Ellipsoids()) << pose;
  }
  EXPECT_EQ(with->Observations(), without->Observations());
  EXPECT_EQ(with->Observations().sum(), this->boxes() - (this->boxes() + 2) / 3);
  std::vector<int> unused;
  EXPECT_EQ(with->ToGraph(&unused).boxes.box, without->ToGraph(&unused).boxes.box);
  EXPECT_EQ(with->Smooth(10, 0), without->Smooth(10, 0));
  EXPECT_EQ(with->Poses(), without->Poses());
}

TYPED_TEST(RelabelTest, ToldLateIsToldAtOnce) {
  const auto early = this->Fed(kNone);
  const std::vector<int> early_row = this->row_;
  // Of object 2 nothing is told, of object 3 every other box only.
  const auto late = this->Fed([&](int row) {
    return this->ObjectOf(row) == 2 || (this->ObjectOf(row) == 3 && row % 2 == 0);
  });
  ASSERT_EQ(late->num_objects(), 4);
  late->Relabel(this->NewObject(this->BoxesOf(2), 4, 2));
  std::vector<int> of_3;
  for (const int row : this->BoxesOf(3)) {
    if (row % 2 == 0) of_3.push_back(row);
  }
  late->Relabel(this->Labels(of_3, this->row_[3]));
  this->row_[2] = 4;
  const double cost = this->Converge(early.get());
  EXPECT_NEAR(this->Converge(late.get()), cost, 1e-7 * cost);
  EXPECT_LT((late->Poses() - early->Poses()).cwiseAbs().maxCoeff(), 1e-6);
  for (int object = 0; object < 5; ++object) {
    EXPECT_EQ(late->Observations()[this->row_[object]], this->BoxesOf(object).size());
    EXPECT_LT(
        (late->Ellipsoids().row(this->row_[object]) - early->Ellipsoids().row(early_row[object]))
            .norm(),
        1e-5);
  }
}

TYPED_TEST(RelabelTest, ThereAndBackRestoresTheCost) {
  const auto session = this->Fed(kNone);
  this->Converge(session.get());
  const RowMatrix poses = session->Poses(), ellipsoids = session->Ellipsoids();
  const double cost = session->Clone()->Smooth(1, 0);
  const std::vector<int> of_1 = this->BoxesOf(1);
  const std::vector<int> some(of_1.begin(), of_1.begin() + 3);
  session->Relabel(this->Labels(some, this->row_[2]));
  EXPECT_GT(session->Clone()->Smooth(1, 0), cost + 100);
  session->Relabel(this->Labels(some, -1));
  EXPECT_LT(session->Clone()->Smooth(1, 0), cost);
  session->Relabel(this->Labels(some, this->row_[1]));
  EXPECT_EQ(session->Poses(), poses);
  EXPECT_EQ(session->Ellipsoids(), ellipsoids);
  EXPECT_NEAR(session->Clone()->Smooth(1, 0), cost, 1e-9 * cost);
}

// A session that goes on after it was told late has kept nothing of the old labels.
TYPED_TEST(RelabelTest, GoesOnWithTheNewLabels) {
  auto early = this->Begin(), late = this->Begin();
  std::vector<int> rows = this->row_;
  const int poses = static_cast<int>(this->scene_.truth.poses.rows());
  const int told = poses - 12;
  for (int pose = 0; pose < poses; ++pose) {
    this->row_ = rows;
    const auto waits = [&](int row) { return pose < told && row >= 20 && row % 4 == 0; };
    this->Add(early.get(), pose, kNone, kAll);
    const std::vector<int> early_rows = this->row_;
    this->row_ = rows;
    this->Add(late.get(), pose, waits, kAll);
    ASSERT_EQ(this->row_, early_rows) << "an object began with a box that waits";
    rows = this->row_;
    if (pose != told) continue;
    NewLabels labels;
    std::vector<int> observations, objects;
    for (int row = 20; row < this->boxes() && this->PoseOf(row) < told; row += 4) {
      observations.push_back(row);
      objects.push_back(rows[this->ObjectOf(row)]);
    }
    labels.observation = Eigen::Map<const IndexVector>(observations.data(), observations.size());
    labels.object = Eigen::Map<const IndexVector>(objects.data(), objects.size());
    late->Relabel(labels);
    // Both stand at the same minimum from here on.
    this->Converge(early.get());
    this->Converge(late.get());
  }
  EXPECT_LT((late->Poses() - early->Poses()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(late->Observations(), early->Observations());
}

TYPED_TEST(RelabelTest, AnObjectWithoutObservationsKeepsItsRowAndItsPlace) {
  const auto session = this->Fed(kNone);
  const auto never = this->Fed([&](int row) { return this->ObjectOf(row) == 4; });
  // Rows of the two sessions differ behind object 4's.
  this->Fed(kNone);
  const int row = this->row_[4];
  const RowMatrix before = session->Ellipsoids();
  session->Relabel(this->Labels(this->BoxesOf(4), -1));
  EXPECT_EQ(session->num_objects(), 5);
  EXPECT_EQ(session->Observations()[row], 0);
  const double cost = this->Converge(never.get());
  EXPECT_NEAR(this->Converge(session.get()), cost, 1e-7 * cost);
  EXPECT_LT((session->Poses() - never->Poses()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(session->Ellipsoids().row(row), before.row(row));
  std::vector<int> rows;
  session->ToGraph(&rows);
  EXPECT_EQ(rows.size(), 4);
  session->Relabel(this->Labels(this->BoxesOf(4), row));
  EXPECT_EQ(session->Ellipsoids().row(row), before.row(row));
}

TYPED_TEST(RelabelTest, WrongLabelsChangeNothing) {
  const auto session = this->Fed([](int row) { return row % 4 == 0; });
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto good = [&] { return this->NewObject({0, 4, 8}, 5, 2); };
  std::vector<std::pair<NewLabels, std::string>> wrong(11, {good(), ""});
  wrong[0].first.observation[1] = this->boxes(), wrong[0].second = "observation row 1: unknown id";
  wrong[1].first.observation[2] = -1, wrong[1].second = "observation row 2: unknown id -1";
  wrong[2].first.observation[2] = 0, wrong[2].second = "observation row 2: repeats row 0";
  wrong[3].first.object[1] = 6, wrong[3].second = "object row 1: unknown id 6, there are 6";
  wrong[4].first.object[0] = -2, wrong[4].second = "object row 0: unknown id -2";
  wrong[5].first.object.setConstant(-1);
  wrong[5].second = "ellipsoid row 0: no box shows this object";
  wrong[6].first.ellipsoid(0, 4) = nan, wrong[6].second = "ellipsoid row 0: NaN or infinite";
  wrong[7].first.ellipsoid(0, 3) = 800, wrong[7].second = "ellipsoid row 0: not a finite ellipsoid";
  wrong[8].first.log_size_sigma[0] = 0, wrong[8].second = "log_size_sigma row 0";
  wrong[9].first.ellipsoid.resize(2, 9),
      wrong[9].second = "ellipsoid has shape (2, 9), expected (1, 9)";
  wrong[10].first.object.resize(2), wrong[10].second = "object has 2 entries, expected 3";
  const RowMatrix poses = session->Poses(), ellipsoids = session->Ellipsoids();
  const IndexVector observations = session->Observations();
  const double cost = session->Clone()->Smooth(5, 0);
  for (const auto& [labels, what] : wrong) {
    try {
      session->Relabel(labels);
      FAIL() << what;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
    EXPECT_EQ(session->num_objects(), 5);
    EXPECT_EQ(session->Poses(), poses);
    EXPECT_EQ(session->Ellipsoids(), ellipsoids);
    EXPECT_EQ(session->Observations(), observations);
    EXPECT_EQ(session->Clone()->Smooth(5, 0), cost);
  }
  session->Relabel(good());
  EXPECT_EQ(session->num_objects(), 6);
}

}  // namespace
}  // namespace dqslam::online
