// The input of a session: observations from a pose, and later changes of their objects.
#pragma once

#include <vector>

#include "dqslam/problem/graph.h"

namespace dqslam::online {

/// The observations from one pose.  Objects are given by their rows.  Rows from the number of
/// objects on are new objects, in order.  A box of object -1 waits for its object.
struct StepObservations {
  IndexVector object;
  RowMatrix box;                               ///< (n, 4) undistorted pixels
  RowMatrix covariance;                        ///< (n, 16) pixels^2
  BoolTable truncated;                         ///< (n, 4)
  std::vector<MeasurementTable> measurements;  ///< one table per kind; `pose` is not used
  Eigen::VectorXd log_size_mean;               ///< of the new objects
  Eigen::VectorXd log_size_sigma;
};

/// New objects of boxes, which are given by their rows in the history.  A box of object -1 waits.
/// Rows from the number of objects on are new objects, in order.
struct NewLabels {
  IndexVector observation;
  IndexVector object;
  RowMatrix ellipsoid;            ///< (m, 9) initial new objects, log-Cholesky, in the world
  Eigen::VectorXd log_size_mean;  ///< of the new objects
  Eigen::VectorXd log_size_sigma;
};

}  // namespace dqslam::online
