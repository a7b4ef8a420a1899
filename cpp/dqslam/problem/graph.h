// The problem as plain tables, and the state and summary of its solution.  Ids are row numbers.
#pragma once

#include <string>
#include <vector>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/pose.h"
#include "dqslam/geometry/shape.h"

namespace dqslam {

/// Relative poses between two rows of `initial_poses`.  d is the size of a pose, k of its tangent.
struct OdometryTable {
  IndexVector from, to;
  RowMatrix relative;    ///< (n, d): from_pose^-1 o to_pose
  RowMatrix covariance;  ///< (n, k * k) of the error (from o relative) (-) to
  int size() const { return static_cast<int>(from.size()); }
};

/// Detected boxes with their known objects.
struct BoxTable {
  IndexVector pose, object;
  RowMatrix box;         ///< (n, 4) undistorted pixels
  RowMatrix covariance;  ///< (n, 16) pixels^2
  BoolTable truncated;   ///< (n, 4) edges where the image border cut the object
  int size() const { return static_cast<int>(pose.size()); }
};

/// Measurements of one kind between poses and objects, other than boxes.  Each has m values.
struct MeasurementTable {
  std::string kind;  ///< "position" or "range": the costs of costs/measurements.h
  IndexVector pose, object;
  RowMatrix value;       ///< (n, m) meters; a position is object_in_robot, [S&M17] eq. (8)
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
  Eigen::VectorXd log_mean, log_sigma;  ///< one row for each object
  /// The row of the shared number that is added to log_mean, or -1; if empty, -1 for all.
  IndexVector shared = {};
};

/// The row of the shared number of an object's prior, or -1.
inline int SharedOf(const IndexVector& shared, int object) {
  return shared.size() == 0 ? -1 : shared[object];
}

/// Prior knowledge of the scene.  Each part is off while its sigma is 0.
struct ScenePriors {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< unit normal n of the ground, in the world
  double plane_offset = 0;                        ///< d of the ground n.x + d = 0, meters
  double upright_sigma = 0;        ///< radians: a principal axis of each object is vertical
  double support_sigma = 0;        ///< meters: each object stands on the ground
  double camera_height = 0;        ///< meters above the ground
  double camera_height_sigma = 0;  ///< meters
};

/// How an object is placed; the residuals are in costs/placements.h.
enum class Placement { kOn, kBeside, kAligned, kUpright };

/// Placements, each of which may be wrong.  They are priors along the vector `up` of the scene.
struct PlacementTable {
  std::vector<Placement> kind;
  IndexVector object;
  IndexVector other;   ///< the object that it refers to, or -1 for a plane or none
  IndexVector shared;  ///< of kOn a plane: the shared number that is added to its height; else -1
  /// Meters: the height of the plane, or the largest horizontal distance of kBeside.
  Eigen::VectorXd distance;
  Eigen::VectorXd sigma;  ///< meters or radians
  int size() const { return static_cast<int>(object.size()); }
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
  std::vector<Shape> shapes = {};  ///< one for each object; if empty, all are ellipsoids
  /// The sigma of each shared number: an unknown that priors of several objects have in common, as
  /// the logarithm of their common size, or the height of a plane.  Its mean is 0.
  Eigen::VectorXd shared_sigma = {};
  PlacementTable placements = {};

  int num_poses() const { return static_cast<int>(initial_poses.rows()); }
  int num_objects() const { return static_cast<int>(size_prior.log_mean.size()); }
  int num_shared() const { return static_cast<int>(shared_sigma.size()); }
  int pose_size() const { return pose_model == PoseModel::kSe2 ? Se2::kSize : Se3::kSize; }
  int tangent_size() const {
    return pose_model == PoseModel::kSe2 ? Se2::kTangentSize : Se3::kTangentSize;
  }
};

/// Throws std::invalid_argument, naming the table and the row, for NaN or infinite numbers, wrong
/// shapes, ids out of range, inverted boxes, covariances that are not positive definite,
/// quaternions that are not unit, non-positive sigmas, objects without a box, and poses without
/// odometry from an earlier pose (unless `poses_known`).
void Validate(const Graph& graph, bool poses_known);

/// Poses and landmarks at the start, during or at the end of a solve.
struct State {
  RowMatrix poses;                ///< (poses, d)
  RowMatrix landmarks;            ///< (objects, 9) in the landmark model of the solve
  Eigen::VectorXd switches = {};  ///< (boxes) of switchable constraints: 1 is on, 0 is off
  /// How the rows of `landmarks` are read; if empty, all are in the landmark model.  Cuboids and
  /// cylinders have the parameters of geometry/body.h.
  std::vector<Shape> shapes = {};
  Eigen::VectorXd shared = {};  ///< the shared numbers; if empty, all are 0

  /// A shared number; that of row -1 is 0.
  const double* SharedAt(int row) const {
    static constexpr double kZero = 0;
    return row < 0 || shared.size() == 0 ? &kZero : &shared[row];
  }
};

/// The size prior of an object, at the shared numbers of a state.
inline SizePrior SizePriorOf(const Graph& graph, const State& state, int object) {
  const SizePriorTable& table = graph.size_prior;
  return {table.log_mean[object] + *state.SharedAt(SharedOf(table.shared, object)),
          table.log_sigma[object]};
}

struct Summary {
  /// Half the sum of squared residuals, in sigmas and after the loss, at the start of the first
  /// stage.
  double initial_cost = 0;
  /// Half the sum of squared residuals, in sigmas and after the loss, at the end of the last stage.
  double final_cost = 0;
  int iterations = 0;                ///< iterations of all stages
  int rejected_steps = 0;            ///< rejected steps of all stages
  double gradient_norm_start = 0;    ///< infinity norm at the start of the last stage
  double gradient_norm_end = 0;      ///< infinity norm at the end of the last stage
  double seconds = 0;                ///< wall-clock time of all stages
  double start_seconds = 0;          ///< the part of `seconds` until all objects had a start
  double evaluation_seconds = 0;     ///< time for residuals and their derivatives, all stages
  double linear_solver_seconds = 0;  ///< time to order, factorize and solve, all stages
  /// Whether the last stage met a stopping test, with no decrease of the cost left that its model
  /// sees, and nothing speaks against the result: the boxes fit, and so does the odometry.
  bool converged = false;
  std::string message;  ///< the reason why the last stage ended, or what speaks against the result
};

/// Adds a stage to the summary of all stages so far.  Counts and times add up, initial_cost remains
/// that of the first stage, and the other fields become those of the new one.
void Append(const Summary& stage, Summary* total);

/// The summary in one readable line.
std::string ToString(const Summary& summary);

}  // namespace dqslam
