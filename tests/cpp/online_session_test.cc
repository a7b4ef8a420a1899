#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "dqslam/online/session.h"
#include "scene.h"

namespace dqslam::online {
namespace {

constexpr double kSizeSigma = 0.5;

// The scene with noise of boxes and odometry, and sessions that are told of it.
template <typename Pose>
class SessionTest : public testing::Test {
 public:
  static constexpr int k = Pose::kTangentSize;

  SessionTest() : scene_(MakeScene<Pose>()) { Disturb(1, 0.01); }

  void Disturb(double box_sigma, double step_sigma) {
    Random random(5);
    for (double& edge : scene_.graph.boxes.box.reshaped()) edge += box_sigma * random.Normal();
    for (int row = 0; row < scene_.graph.odometry.relative.rows(); ++row) {
      Eigen::Matrix<double, k, 1> tangent;
      for (double& one : tangent) one = step_sigma * random.Normal();
      Eigen::Matrix<double, Pose::kSize, 1> noise, relative;
      Pose::FromTangent(tangent.data(), noise.data());
      Pose::Compose(scene_.graph.odometry.relative.row(row).data(), noise.data(), relative.data());
      scene_.graph.odometry.relative.row(row) = relative.transpose();
    }
  }

  int boxes() const { return static_cast<int>(scene_.graph.boxes.pose.size()); }
  int PoseOf(int box) const { return scene_.graph.boxes.pose[box]; }
  int ObjectOf(int box) const { return scene_.graph.boxes.object[box]; }

  std::vector<int> BoxesOf(int object) const {
    std::vector<int> rows;
    for (int row = 0; row < boxes(); ++row) {
      if (ObjectOf(row) == object) rows.push_back(row);
    }
    return rows;
  }

  // A session without a step; row_ of it has no object.
  std::unique_ptr<Session> Begin(const OnlineOptions& options = {}) {
    row_.assign(scene_.truth.landmarks.rows(), -1);
    return Session::Make(Pose::kModel, scene_.graph.camera, ScenePriors(), options);
  }

  // Adds a pose; the boxes that `waits` names have no object yet, those that `given` does not name
  // are not there at all.  Rows of observations are those of the boxes while all are given.
  template <typename Waits, typename Given>
  StepReport Add(Session* session, int pose, Waits&& waits, Given&& given) {
    std::vector<int> rows, objects;
    int born = 0;
    for (int row = 0; row < boxes(); ++row) {
      if (PoseOf(row) != pose || !given(row)) continue;
      rows.push_back(row);
      int& own = row_[ObjectOf(row)];
      if (own < 0 && !waits(row)) own = session->num_objects() + born++;
      objects.push_back(waits(row) ? -1 : own);
    }
    const int n = static_cast<int>(rows.size());
    StepObservations observations;
    observations.object = Eigen::Map<const IndexVector>(objects.data(), n);
    observations.box.resize(n, 4);
    observations.covariance.resize(n, 16);
    observations.truncated = BoolTable::Constant(n, 4, false);
    for (int i = 0; i < n; ++i) {
      observations.box.row(i) = scene_.graph.boxes.box.row(rows[i]);
      observations.covariance.row(i) = scene_.graph.boxes.covariance.row(rows[i]);
    }
    observations.log_size_mean = Eigen::VectorXd::Constant(born, std::log(0.3));
    observations.log_size_sigma = Eigen::VectorXd::Constant(born, kSizeSigma);
    if (pose == 0) return session->Add(scene_.truth.poses.row(0), RowMatrix(), observations);
    const RowMatrix covariance =
        scene_.graph.odometry.covariance.row(pose - 1).reshaped(k, k).eval();
    return session->Add(scene_.graph.odometry.relative.row(pose - 1), covariance, observations);
  }

  template <typename Waits>
  std::unique_ptr<Session> Fed(Waits&& waits) {
    auto session = Begin();
    for (int pose = 0; pose < scene_.truth.poses.rows(); ++pose) {
      Add(session.get(), pose, waits, [](int) { return true; });
    }
    return session;
  }

  // One new object, from the truth but for a meter.
  NewLabels NewObject(const std::vector<int>& observations, int row, int object) const {
    NewLabels labels = Labels(observations, row);
    labels.ellipsoid = scene_.truth.landmarks.row(object);
    labels.ellipsoid(0, 0) += 0.2;
    labels.log_size_mean = Eigen::VectorXd::Constant(1, std::log(0.3));
    labels.log_size_sigma = Eigen::VectorXd::Constant(1, kSizeSigma);
    return labels;
  }

  static NewLabels Labels(const std::vector<int>& observations, int row) {
    NewLabels labels;
    labels.observation = Eigen::Map<const IndexVector>(observations.data(), observations.size());
    labels.object = IndexVector::Constant(observations.size(), row);
    return labels;
  }

  static double Converge(Session* session) {
    double cost = 0;
    for (int round = 0; round < 40; ++round) cost = session->Smooth(10, 0);
    return cost;
  }

  Scene scene_;
  std::vector<int> row_;  ///< of each object in the session
};

const auto kNone = [](int) { return false; };
const auto kAll = [](int) { return true; };

using Poses = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(SessionTest, Poses);

TYPED_TEST(SessionTest, BoxesThatWaitTakeNoPart) {
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

TYPED_TEST(SessionTest, ToldLateIsToldAtOnce) {
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

TYPED_TEST(SessionTest, ThereAndBackRestoresTheCost) {
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
TYPED_TEST(SessionTest, GoesOnWithTheNewLabels) {
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

TYPED_TEST(SessionTest, AnObjectWithoutObservationsKeepsItsRowAndItsPlace) {
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

TYPED_TEST(SessionTest, WrongLabelsChangeNothing) {
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

}  // namespace
}  // namespace dqslam::online
