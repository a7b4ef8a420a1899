// What a caller tells a session: what a pose saw, and later which objects its boxes show.
#pragma once

#include "dqslam/geometry/blocks.h"

namespace dqslam::online {

/// What one pose saw.  Objects are rows; those from the number of objects on are new, in order, and
/// a box of -1 waits for its object.
struct StepObservations {
  IndexVector object;
  RowMatrix box;         ///< (n, 4) undistorted pixels
  RowMatrix covariance;  ///< (n, 16) pixels^2
  BoolTable truncated;   ///< (n, 4)
  IndexVector position_object;
  RowMatrix position;             ///< (p, 3) object_in_robot, meters
  RowMatrix position_covariance;  ///< (p, 9) meters^2
  Eigen::VectorXd log_size_mean;  ///< of the new objects
  Eigen::VectorXd log_size_sigma;
};

/// Boxes by their rows in the history, and the object each is of now: -1 waits, those from the
/// number of objects on are new, in order.
struct NewLabels {
  IndexVector observation;
  IndexVector object;
  RowMatrix ellipsoid;  ///< (m, 9) where the new objects start, log-Cholesky, in the world
  Eigen::VectorXd log_size_mean;  ///< of the new objects
  Eigen::VectorXd log_size_sigma;
};

}  // namespace dqslam::online
