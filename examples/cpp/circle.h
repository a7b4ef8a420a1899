#pragma once

#include <dqslam/dqslam.h>

#include <cmath>
#include <tuple>

/// A robot drives a circle of 5 m, a step every 30 degrees, and looks at an object to its left.
/// Odometry and boxes are simulated without an error, so that the answer is known.
inline dqslam::Graph MakeCircle() {
  using namespace dqslam;
  constexpr int kPoses = 12, kSteps = kPoses - 1;
  const Vector9d truth = EllipsoidFromAxes({0.3, 5.2, 0.6}, {0.5, 0.4, 0.3}, {0, 0, 0, 1});
  const Eigen::RowVector3d step(2.5, 5 - 2.5 * std::sqrt(3.0), M_PI / 6);  // m, m, rad

  Graph graph;
  graph.camera = {400, 400, 319.5, 239.5, 640, 480};
  graph.camera.robot_from_camera << 0, 0, 0.5, -M_SQRT1_2, 0, 0, M_SQRT1_2;  // looks left

  OdometryTable& odometry = graph.odometry;
  odometry.from = IndexVector::LinSpaced(kSteps, 0, kSteps - 1);
  odometry.to = IndexVector::LinSpaced(kSteps, 1, kSteps);
  odometry.relative = step.replicate(kSteps, 1);
  odometry.covariance = 4e-4 * Eigen::Matrix3d::Identity().reshaped(1, 9).replicate(kSteps, 1);
  graph.initial_poses =
      DeadReckonRows(graph.pose_model, Eigen::Vector3d::Zero(), odometry.relative);

  BoxTable& boxes = graph.boxes;
  boxes.pose = IndexVector::LinSpaced(kPoses, 0, kPoses - 1);
  boxes.object = IndexVector::Zero(kPoses);
  std::tie(boxes.box, std::ignore) = ProjectToBoxesRows(
      graph.pose_model, graph.camera, graph.initial_poses, truth.transpose().replicate(kPoses, 1));
  boxes.covariance = Eigen::Matrix4d::Identity().reshaped(1, 16).replicate(kPoses, 1);
  boxes.truncated = BoolTable::Constant(kPoses, kBoxSize, false);
  graph.size_prior.log_mean = Eigen::VectorXd::Constant(1, std::log(0.4));
  graph.size_prior.log_sigma = Eigen::VectorXd::Constant(1, 1.0);
  return graph;
}
