// The problem as plain tables, and the answer.  Ids are row numbers.  No Ceres here.
#pragma once

#include <string>
#include <vector>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// Relative poses between two rows of `initial_poses`.  d pose size, k tangent size.
struct OdometryTable {
  IndexVector from, to;
  RowMatrix relative;    ///< (n, d): from_pose^-1 o to_pose
  RowMatrix covariance;  ///< (n, k * k), of (from o relative) (-) to
  int size() const { return static_cast<int>(from.size()); }
};

/// Detections whose object is known.
struct BoxTable {
  IndexVector pose, object;
  RowMatrix box;         ///< (n, 4) undistorted pixels
  RowMatrix covariance;  ///< (n, 16) pixels^2
  BoolTable truncated;   ///< (n, 4) edges that the image border cut: the object goes on beyond
  int size() const { return static_cast<int>(pose.size()); }
};

/// Measurements of one kind between poses and objects, beside boxes: m numbers each.
struct MeasurementTable {
  std::string kind;  ///< "position" or "range": the costs of costs/measurements.h
  IndexVector pose, object;
  RowMatrix value;       ///< (n, m); of positions object_in_robot, meters, [S&M17] eq. (8)
  RowMatrix covariance;  ///< (n, m * m)
  int size() const { return static_cast<int>(pose.size()); }
};

/// Gaussian prior on the logarithm of one object's semi-axes [log meters].
struct SizePrior {
  double log_mean = 0;
  double log_sigma = 1;
};

/// The same for every object of a graph.
struct SizePriorTable {
  Eigen::VectorXd log_mean, log_sigma;  ///< one row an object
};

/// What is known of the scene; each part is off while its sigma is 0.
struct ScenePriors {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< unit normal n of the ground, in the world
  double plane_offset = 0;                        ///< d of the ground n.x + d = 0, meters
  double upright_sigma = 0;        ///< radians: a principal axis of each object is vertical
  double support_sigma = 0;        ///< meters: each object stands on the ground
  double camera_height = 0;        ///< meters above the ground
  double camera_height_sigma = 0;  ///< meters
};

struct Graph {
  PoseModel pose_model = PoseModel::kSe2;
  Camera camera;
  RowMatrix initial_poses;  ///< (poses, d): dead reckoning, or the known poses when mapping
  OdometryTable odometry;
  BoxTable boxes;
  std::vector<MeasurementTable> measurements;
  SizePriorTable size_prior;
  ScenePriors scene_priors;

  int num_poses() const { return static_cast<int>(initial_poses.rows()); }
  int num_objects() const { return static_cast<int>(size_prior.log_mean.size()); }
  int pose_size() const { return pose_model == PoseModel::kSe2 ? Se2::kSize : Se3::kSize; }
  int tangent_size() const {
    return pose_model == PoseModel::kSe2 ? Se2::kTangentSize : Se3::kTangentSize;
  }
};

/// Throws std::invalid_argument naming the table and the row for NaN or infinite numbers, wrong
/// shapes, ids out of range, inverted boxes, covariances that are not positive definite,
/// quaternions that are not unit, non-positive sigmas, poses without odometry from an earlier pose
/// (unless `poses_known`) and objects that no box shows.
void Validate(const Graph& graph, bool poses_known);

/// Poses and landmarks: where a solve starts, stands and ends.
struct State {
  RowMatrix poses;                ///< (poses, d)
  RowMatrix landmarks;            ///< (objects, 9) in the landmark model of the solve
  Eigen::VectorXd switches = {};  ///< (boxes) of switchable constraints: 1 believed, 0 not
};

struct Summary {
  double initial_cost = 0;         ///< half the sum of squared residuals, in sigmas, after the loss
  double final_cost = 0;           ///< likewise
  int iterations = 0;              ///< of all stages
  int rejected_steps = 0;          ///< of all stages
  double gradient_norm_start = 0;  ///< infinity norm, at the start of the last stage
  double gradient_norm_end = 0;    ///< likewise, at its end
  double seconds = 0;              ///< wall clock, all stages
  double start_seconds = 0;        ///< of these, until all objects had a start
  double evaluation_seconds = 0;   ///< of all stages: residuals and their derivatives
  double linear_solver_seconds = 0;  ///< of all stages: orderings, factorizations, solutions
  bool converged = false;            ///< the last stage met a stopping test and accepted a step
  std::string message;               ///< how it ended, in words
};

/// Makes `total` the summary of all stages so far: counts add up, the rest is the last stage's.
void Append(const Summary& stage, Summary* total);

/// One line for people.
std::string ToString(const Summary& summary);

}  // namespace dqslam
