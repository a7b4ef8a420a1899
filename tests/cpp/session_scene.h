// A scene that sessions see step by step, with boxes that get their objects late or never.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "dqslam/online/session.h"
#include "scene.h"

namespace dqslam::online {

inline constexpr double kSizeSigma = 0.5;

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

}  // namespace dqslam::online
