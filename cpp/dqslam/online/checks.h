// What a caller gives a session is checked before anything changes: std::invalid_argument names the
// table and the row.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "dqslam/costs/whitening.h"
#include "dqslam/online/history.h"
#include "dqslam/online/observations.h"

namespace dqslam::online {

[[noreturn]] void FailAt(const std::string& table, Eigen::Index row, const std::string& what);

void CheckShape(const char* table, const RowMatrix& values, Eigen::Index rows, int columns);

/// Size priors of new objects, as many means as sigmas.
void CheckSizes(const Eigen::VectorXd& log_mean, const Eigen::VectorXd& log_sigma);

void CheckDistinct(const char* table, const IndexVector& rows);

/// Square root of the information in one row of a table of covariances.
template <int n>
Eigen::Matrix<double, n, n> Whitening(const std::string& table,
                                      const RowMatrix& covariances,
                                      Eigen::Index row) {
  using Square = Eigen::Matrix<double, n, n, Eigen::RowMajor>;
  try {
    return SqrtInformation<n>(Eigen::Map<const Square>(covariances.row(row).data()));
  } catch (const std::invalid_argument& error) {
    FailAt(table, row, error.what());
  }
}

/// What a pose saw as rows of a history, for a pose and a number of objects that there are.
std::vector<Observation> CheckedObservations(const StepObservations& given, int pose, int objects);

/// Odometry as a history keeps it; of a first pose that is known there is no covariance.
template <typename Pose>
typename History<Pose>::Step CheckedStep(const Eigen::VectorXd& relative,
                                         const RowMatrix& covariance,
                                         bool first_is_known);

}  // namespace dqslam::online
