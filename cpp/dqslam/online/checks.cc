#include "dqslam/online/checks.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace dqslam::online {

void FailAt(const std::string& table, Eigen::Index row, const std::string& what) {
  throw std::invalid_argument(table + " row " + std::to_string(row) + ": " + what);
}

void CheckShape(const char* table, const RowMatrix& values, Eigen::Index rows, int columns) {
  if (values.rows() == rows && (rows == 0 || values.cols() == columns)) return;
  throw std::invalid_argument(std::string(table) + ": expected " + std::to_string(rows) +
                              " rows of " + std::to_string(columns));
}

void CheckSizes(const Eigen::VectorXd& log_mean, const Eigen::VectorXd& log_sigma) {
  if (log_sigma.size() != log_mean.size()) {
    throw std::invalid_argument("log_size_sigma: expected one for each of log_size_mean");
  }
  for (Eigen::Index row = 0; row < log_mean.size(); ++row) {
    if (!std::isfinite(log_mean[row]) || !(log_sigma[row] > 0)) {
      FailAt("log_size_sigma", row, "expected a finite mean and a positive sigma");
    }
  }
}

void CheckDistinct(const char* table, const IndexVector& rows) {
  std::vector<Eigen::Index> order(rows.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    return rows[a] < rows[b];
  });
  for (size_t i = 1; i < order.size(); ++i) {
    if (rows[order[i]] == rows[order[i - 1]]) {
      FailAt(table, order[i], "repeats row " + std::to_string(order[i - 1]));
    }
  }
}

std::vector<Observation> CheckedObservations(const StepObservations& given, int pose, int objects) {
  const Eigen::Index boxes = given.object.size(), positions = given.position_object.size();
  CheckShape("boxes", given.box, boxes, kBoxSize);
  CheckShape("box_covariance", given.covariance, boxes, 16);
  CheckShape("positions", given.position, positions, 3);
  CheckShape("position_covariance", given.position_covariance, positions, 9);
  if (given.truncated.rows() != boxes || (boxes > 0 && given.truncated.cols() != kBoxSize)) {
    throw std::invalid_argument("box_truncated: expected a row of 4 for each box");
  }
  const Eigen::Index born = given.log_size_mean.size();
  CheckSizes(given.log_size_mean, given.log_size_sigma);
  std::vector<bool> seen(born, false);
  std::vector<Observation> observations;
  for (Eigen::Index row = 0; row < boxes + positions; ++row) {
    const bool is_box = row < boxes;
    const Eigen::Index own = is_box ? row : row - boxes;
    const char* table = is_box ? "boxes" : "positions";
    Observation observation;
    observation.pose = pose;
    observation.object = is_box ? given.object[own] : given.position_object[own];
    observation.is_box = is_box;
    const int least = is_box ? -1 : 0;
    if (observation.object < least || observation.object >= objects + born)
      FailAt(table, own, "no such object");
    if (observation.object >= objects) seen[observation.object - objects] = true;
    if (is_box) {
      observation.value = given.box.row(own).transpose();
      observation.sqrt_information = Whitening<4>("box_covariance", given.covariance, own);
      observation.truncated = given.truncated.row(own);
      if (observation.value[0] >= observation.value[2] ||
          observation.value[1] >= observation.value[3]) {
        FailAt(table, own, "inverted or empty box");
      }
    } else {
      observation.value << given.position.row(own).transpose(), 0;
      observation.sqrt_information.setZero();
      observation.sqrt_information.topLeftCorner<3, 3>() =
          Whitening<3>("position_covariance", given.position_covariance, own);
    }
    if (!observation.value.allFinite()) FailAt(table, own, "NaN or infinite number");
    observations.push_back(observation);
  }
  for (Eigen::Index row = 0; row < born; ++row) {
    if (!seen[row]) FailAt("log_size_mean", row, "the new object is not seen");
  }
  return observations;
}

template <typename Pose>
typename History<Pose>::Step CheckedStep(const Eigen::VectorXd& relative,
                                         const RowMatrix& covariance,
                                         bool first_is_known) {
  constexpr int k = Pose::kTangentSize;
  if (relative.size() != Pose::kSize || !relative.allFinite()) {
    throw std::invalid_argument("odometry: expected " + std::to_string(Pose::kSize) +
                                " finite numbers");
  }
  if (Pose::kModel == PoseModel::kSe3 && std::abs(relative.tail<4>().norm() - 1) > 1e-6) {
    throw std::invalid_argument("odometry: the quaternion is not unit");
  }
  typename History<Pose>::Step step;
  step.relative = relative;
  step.covariance.setIdentity();
  step.sqrt_information.setIdentity();
  step.first_observation = 0;
  if (first_is_known) return step;
  if (covariance.rows() != k || covariance.cols() != k) {
    throw std::invalid_argument("odometry_covariance: expected shape (" + std::to_string(k) + ", " +
                                std::to_string(k) + ")");
  }
  step.covariance = covariance;
  try {
    step.sqrt_information = SqrtInformation<k>(step.covariance);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(std::string("odometry_covariance: ") + error.what());
  }
  return step;
}

template History<Se2>::Step CheckedStep<Se2>(const Eigen::VectorXd&, const RowMatrix&, bool);
template History<Se3>::Step CheckedStep<Se3>(const Eigen::VectorXd&, const RowMatrix&, bool);

}  // namespace dqslam::online
