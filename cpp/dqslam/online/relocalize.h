// Where the robot is in a known map, from a few boxes and no odometry.
//
// Every hypothesis sets out from a box that shows some object: the object's size gives the range,
// and the heading is tried all around.  Levenberg-Marquardt on the pose, with the tangent residual
// until all objects are in front, takes it on; all boxes then judge it.
#pragma once

#include <limits>
#include <vector>

#include "dqslam/geometry/camera.h"

namespace dqslam::online {

/// A map and one image.
struct MapView {
  RowMatrix ellipsoids;      ///< (objects, 9) log-Cholesky parameters
  RowMatrix covariance;      ///< (objects, 81) of these
  RowMatrix box;             ///< (boxes, 4) undistorted pixels
  RowMatrix box_covariance;  ///< (boxes, 16) pixels^2
  BoolTable truncated;       ///< (boxes, 4)
  /// Objects that each box may show; of one that is known, that one.
  std::vector<std::vector<int>> candidates;
};

struct Relocation {
  Eigen::VectorXd pose;   ///< world_from_robot
  RowMatrix covariance;   ///< (k, k) in the tangent of the pose, of the map's errors too
  IndexVector object;     ///< of each box; -1 for none
  double chi_square = 0;  ///< of the boxes that have an object
  int matches = 0;        ///< these boxes
  /// Chi-square of the best other place with as many matches; infinite where there is none.
  double runner_up = std::numeric_limits<double>::infinity();
  Eigen::VectorXd other;  ///< that place
};

/// Throws std::invalid_argument where fewer boxes than `fewest` show objects of the map, or none of
/// the hypotheses explains so many of them.
Relocation Relocalize(PoseModel pose_model, const Camera& camera, const MapView& view, int fewest);

}  // namespace dqslam::online
