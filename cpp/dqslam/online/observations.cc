#include "dqslam/online/observations.h"

#include "dqslam/online/checks.h"

namespace dqslam::online {

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

}  // namespace dqslam::online
