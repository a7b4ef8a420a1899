// The pose of the robot in a known map, from a few boxes and without odometry.
//
// Every hypothesis starts from a box and an object that it may show.  The size of the object gives
// the range, and all headings are tried.  Levenberg-Marquardt refines the pose, with the tangent
// residual until all objects are in front.  All boxes then score the hypothesis.
#pragma once

#include <limits>
#include <vector>

#include "dqslam/geometry/camera.h"

namespace dqslam::online {

/// A map and one image.
struct MapView {
  RowMatrix ellipsoids;      ///< (objects, 9) log-Cholesky parameters
  RowMatrix covariance;      ///< (objects, 81) covariances of these
  RowMatrix box;             ///< (boxes, 4) undistorted pixels
  RowMatrix box_covariance;  ///< (boxes, 16) pixels^2
  BoolTable truncated;       ///< (boxes, 4)
  /// The objects that each box may show.  A box of a known object has only that one.
  std::vector<std::vector<int>> candidates;
};

struct Relocation {
  Eigen::VectorXd pose;   ///< world_from_robot
  RowMatrix covariance;   ///< (k, k) in the tangent of the pose; includes the errors of the map
  IndexVector object;     ///< object of each box; -1 for none
  double chi_square = 0;  ///< sum over the boxes that have an object
  int matches = 0;        ///< number of these boxes
  /// Chi-square of the best other pose with as many matches; infinite if there is none.
  double runner_up = std::numeric_limits<double>::infinity();
  Eigen::VectorXd other;  ///< that other pose
};

/// Throws std::invalid_argument if fewer boxes than `fewest` may show objects of the map, or if no
/// hypothesis explains that number of boxes.
Relocation Relocalize(PoseModel pose_model, const Camera& camera, const MapView& view, int fewest);

}  // namespace dqslam::online
