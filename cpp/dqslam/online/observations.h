// What a step brings, as a caller gives it, and as a history keeps it.
#pragma once

#include "dqslam/online/history.h"

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

/// As rows of a history, for a pose and a number of objects that there are.  Throws
/// std::invalid_argument naming the table and the row for what is wrong.
std::vector<Observation> CheckedObservations(const StepObservations& given, int pose, int objects);

/// Odometry; of a first pose that is known there is no covariance.  Throws std::invalid_argument.
template <typename Pose>
typename History<Pose>::Step CheckedStep(const Eigen::VectorXd& relative,
                                         const RowMatrix& covariance,
                                         bool first_is_known);

}  // namespace dqslam::online
