// What a caller gives a session: what a pose saw, and later which objects its boxes show.
#pragma once

#include <vector>

#include "dqslam/problem/graph.h"

namespace dqslam::online {

/// What one pose saw.  Objects are rows; those from the number of objects on are new, in order, and
/// a box of -1 waits for its object.
struct StepObservations {
  IndexVector object;
  RowMatrix box;                               ///< (n, 4) undistorted pixels
  RowMatrix covariance;                        ///< (n, 16) pixels^2
  BoolTable truncated;                         ///< (n, 4)
  std::vector<MeasurementTable> measurements;  ///< one a kind; `pose` is not used
  Eigen::VectorXd log_size_mean;               ///< of the new objects
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
