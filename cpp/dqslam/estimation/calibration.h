// Score tests of what a problem takes for known: the camera, its mount, and systematic errors of
// the odometry.  They tell what the boxes would say about each of these if it were estimated with
// all poses and objects, from one linearization at the estimate.
#pragma once

#include <vector>

#include "dqslam/problem/graph.h"
#include "dqslam/problem/options.h"

namespace dqslam {

/// A deviation from what the graph takes for known.
struct CalibrationParameter {
  const char* name;
  const char* unit;
  double step;  ///< of the numerical derivatives, in that unit
};

/// Rotation of the mount [rad] about the axes of the camera (pitch, yaw, roll) and its position [m]
/// along those of the robot; relative focal length; principal point [px]; distortion k1; relative
/// scale of the odometry's translations; bias of its rotations about the vertical [rad/s]; delay of
/// the images [s]; logarithm of a factor that is common to the prior sizes of all objects.
const std::vector<CalibrationParameter>& CalibrationParameters();

/// For p parameters: the score s = -Jp^T P r and the information S = Jp^T P Jp, where r are the
/// whitened residuals, Jp their derivatives by the parameters, and P projects out all poses and
/// objects.  A parameter alone has the estimate s_i / S_ii.
struct CalibrationScore {
  Eigen::VectorXd score;
  RowMatrix information;      ///< (p, p)
  Eigen::VectorXd unchecked;  ///< diagonal of Jp^T Jp: the information if all else were known
  /// The parts of the covariance of the score, (p, p), that come from the noise of odometry and of
  /// boxes.
  RowMatrix from_odometry, from_boxes;
};

/// `timestamps` [s] are those of the poses.  With a robust loss, boxes that are outliers at the
/// state are left out.  Throws std::invalid_argument for a state or timestamps that do not fit the
/// graph, and std::runtime_error where a residual of the last stage is undefined at the state.
CalibrationScore ScoreCalibration(const Graph& graph,
                                  const SolveOptions& options,
                                  const State& state,
                                  const Eigen::VectorXd& timestamps);

/// The graph with deviations of its parameters, one value for each.  A delay of the images moves
/// the boxes as the state predicts it.
Graph Recalibrate(const Graph& graph,
                  const State& state,
                  const Eigen::VectorXd& timestamps,
                  const Eigen::VectorXd& deviations);

}  // namespace dqslam
