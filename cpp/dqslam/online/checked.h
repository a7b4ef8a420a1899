// A step as a history keeps it, once it is known to be right.
#pragma once

#include <vector>

#include "dqslam/online/history.h"
#include "dqslam/online/observations.h"

namespace dqslam::online {

/// As rows of a history, for a pose and a number of objects that there are.  Throws
/// std::invalid_argument naming the table and the row for what is wrong.
std::vector<Observation> CheckedObservations(const StepObservations& given, int pose, int objects);

/// Odometry; of a first pose that is known there is no covariance.  Throws std::invalid_argument.
template <typename Pose>
typename History<Pose>::Step CheckedStep(const Eigen::VectorXd& relative,
                                         const RowMatrix& covariance,
                                         bool first_is_known);

}  // namespace dqslam::online
