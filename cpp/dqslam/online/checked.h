// Checks the input of a session and converts it to the form of a history.
#pragma once

#include <vector>

#include "dqslam/online/history.h"
#include "dqslam/online/observations.h"

namespace dqslam::online {

/// Observations from a pose as rows of a history that has a number of objects.  Throws
/// std::invalid_argument naming the table and the row that are wrong.
std::vector<Observation> CheckedObservations(const StepObservations& given, int pose, int objects);

/// Odometry as a step of a history.  A first pose that is known has no covariance.  Throws
/// std::invalid_argument.
template <typename Pose>
typename History<Pose>::Step CheckedStep(const Eigen::VectorXd& relative,
                                         const RowMatrix& covariance,
                                         bool first_is_known);

}  // namespace dqslam::online
