// A small world: a loop around five ellipsoids, seen by a camera that looks into it.  All
// measurements are exact: boxes from the sampled surface, odometry from the true poses.
#pragma once

#include <vector>

#include "dqslam/costs/measurements.h"
#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/problem/graph.h"
#include "oracle.h"
#include "random.h"

namespace dqslam {

struct Scene {
  Graph graph;
  State truth;  ///< landmarks as ellipsoids
};

inline Camera SceneCamera() {
  Camera camera;
  camera.fx = camera.fy = 400;
  camera.cx = 319.5;
  camera.cy = 239.5;
  camera.width = 640;
  camera.height = 480;
  camera.robot_from_camera << 0.1, 0.05, 0.4, -M_SQRT1_2, 0, 0, M_SQRT1_2;  // looks left
  return camera;
}

inline std::vector<oracle::Ellipsoid> SceneObjects() {
  Random random(1);
  std::vector<oracle::Ellipsoid> objects;
  for (const Eigen::Vector3d& center : {Eigen::Vector3d(1.5, 0.2, 0.3),
                                        Eigen::Vector3d(-1.2, 1.1, 0.5),
                                        Eigen::Vector3d(0.2, -1.6, 0.1),
                                        Eigen::Vector3d(-1.3, -0.7, 0.6),
                                        Eigen::Vector3d(0.3, 0.6, -0.2)}) {
    objects.push_back({center, random.UniformVector<3>(0.15, 0.45), random.UnitQuaternion()});
  }
  return objects;
}

/// Pose at `angle` on the loop, counter-clockwise; in SE(3) it rolls, pitches and rises as well.
template <typename Pose>
Eigen::Matrix<double, Pose::kSize, 1> PoseOnLoop(double angle) {
  constexpr double kRadius = 5;
  const double x = kRadius * std::cos(angle), y = kRadius * std::sin(angle);
  const double heading = angle + M_PI / 2;
  Eigen::Matrix<double, Pose::kSize, 1> pose;
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    pose << x, y, heading;
  } else {
    const Eigen::Quaterniond q =
        Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()) *
        Eigen::AngleAxisd(0.1 * std::sin(3 * angle), Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(0.1 * std::cos(2 * angle), Eigen::Vector3d::UnitX());
    pose << x, y, 0.3 * std::sin(2 * angle), q.coeffs();
  }
  return pose;
}

/// Viewpoint of a camera on a robot, by the oracle's own rotation matrices.
template <typename Pose>
oracle::Viewpoint ViewFrom(const double* pose, const Camera& camera) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t(pose[0], pose[1], 0);
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    R.topLeftCorner<2, 2>() << std::cos(pose[2]), -std::sin(pose[2]), std::sin(pose[2]),
        std::cos(pose[2]);
  } else {
    t.z() = pose[2];
    R = oracle::RotationMatrix(Eigen::Vector4d(pose + 3));
  }
  return {R * oracle::RotationMatrix(camera.robot_from_camera.tail<4>()),
          R * camera.robot_from_camera.head<3>() + t};
}

template <typename Pose>
void MeasureOdometry(const RowMatrix& poses, OdometryTable* odometry) {
  const int rows = static_cast<int>(poses.rows()) - 1, k = Pose::kTangentSize;
  odometry->from = IndexVector::LinSpaced(rows, 0, rows - 1);
  odometry->to = IndexVector::LinSpaced(rows, 1, rows);
  odometry->relative.resize(rows, Pose::kSize);
  odometry->covariance.resize(rows, k * k);
  const Eigen::MatrixXd covariance = 0.02 * 0.02 * Eigen::MatrixXd::Identity(k, k);
  for (int row = 0; row < rows; ++row) {
    Pose::Between(
        poses.row(row).data(), poses.row(row + 1).data(), odometry->relative.row(row).data());
    odometry->covariance.row(row) = covariance.reshaped().transpose();
  }
}

/// Boxes of 1 px sigma, of objects that are in front and wholly in the image.
template <typename Pose>
void MeasureBoxes(const Camera& camera,
                  const RowMatrix& poses,
                  const std::vector<oracle::Ellipsoid>& objects,
                  BoxTable* table) {
  std::vector<int> pose_ids, object_ids;
  std::vector<Eigen::Vector4d> boxes;
  for (int pose = 0; pose < poses.rows(); ++pose) {
    const oracle::Viewpoint view = ViewFrom<Pose>(poses.row(pose).data(), camera);
    for (int object = 0; object < static_cast<int>(objects.size()); ++object) {
      if (oracle::NearestDepth(view, objects[object]) < 0.1) continue;
      const Eigen::Vector4d box = oracle::Box(camera, view, objects[object]);
      if (!camera.Shows(box[0], box[1]) || !camera.Shows(box[2], box[3])) continue;
      pose_ids.push_back(pose);
      object_ids.push_back(object);
      boxes.push_back(box);
    }
  }
  const int rows = static_cast<int>(boxes.size());
  table->pose = Eigen::Map<IndexVector>(pose_ids.data(), rows);
  table->object = Eigen::Map<IndexVector>(object_ids.data(), rows);
  table->box = Eigen::Map<RowMatrix>(boxes[0].data(), rows, kBoxSize);
  table->covariance = Eigen::Matrix4d::Identity().reshaped().transpose().replicate(rows, 1);
  table->truncated = BoolTable::Constant(rows, kBoxSize, false);
}

/// Two measurements of each kind beside boxes, which do not fit.
inline void AddMeasurements(Graph* graph) {
  for (int kind = 0; kind < kNumMeasurementKinds; ++kind) {
    const int m = MeasurementSize(kind);
    const Eigen::MatrixXd covariance = 0.04 * Eigen::MatrixXd::Identity(m, m);
    graph->measurements.push_back({MeasurementName(kind),
                                   IndexVector::LinSpaced(2, 3, 7),
                                   IndexVector::LinSpaced(2, 1, 2),
                                   RowMatrix::Constant(2, m, 4.0),
                                   covariance.reshaped().transpose().replicate(2, 1)});
  }
}

template <typename Pose>
Scene MakeScene(int num_poses = 40, double laps = 1.1) {
  const std::vector<oracle::Ellipsoid> objects = SceneObjects();
  const int num_objects = static_cast<int>(objects.size());
  Scene scene;
  State& truth = scene.truth;
  truth.poses.resize(num_poses, Pose::kSize);
  for (int pose = 0; pose < num_poses; ++pose) {
    truth.poses.row(pose) = PoseOnLoop<Pose>(2 * M_PI * laps * pose / (num_poses - 1));
  }
  truth.landmarks.resize(num_objects, kLandmarkSize);
  for (int object = 0; object < num_objects; ++object) {
    const oracle::Ellipsoid& e = objects[object];
    truth.landmarks.row(object) = EllipsoidFromAxes(e.center, e.semi_axes, e.orientation_xyzw);
  }
  Graph& graph = scene.graph;
  graph.pose_model = Pose::kModel;
  graph.camera = SceneCamera();
  graph.initial_poses = truth.poses;
  MeasureOdometry<Pose>(truth.poses, &graph.odometry);
  MeasureBoxes<Pose>(graph.camera, truth.poses, objects, &graph.boxes);
  // So broad that it does not pull: the truth is the minimum.
  graph.size_prior.log_mean = Eigen::VectorXd::Constant(num_objects, std::log(0.3));
  graph.size_prior.log_sigma = Eigen::VectorXd::Constant(num_objects, 1e4);
  return scene;
}

}  // namespace dqslam
