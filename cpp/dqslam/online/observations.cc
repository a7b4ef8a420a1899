#include "dqslam/online/observations.h"

#include "dqslam/problem/checks.h"

namespace dqslam::online {

std::vector<Observation> CheckedObservations(const StepObservations& given, int pose, int objects) {
  const int boxes = static_cast<int>(given.box.rows());
  const int positions = static_cast<int>(given.position.rows());
  const Eigen::Index born = given.log_size_mean.size();
  CheckIds("box_object", given.object, boxes, objects + born, -1);
  CheckBoxes(given.box, given.covariance, given.truncated, boxes);
  CheckIds("position_object", given.position_object, positions, objects + born);
  CheckTable("positions", given.position, positions, 3);
  CheckTable("position_covariance", given.position_covariance, positions, 9);
  CheckSizePriors(given.log_size_mean, given.log_size_sigma, born);
  IndexVector shown(boxes + positions);
  shown << given.object, given.position_object;
  CheckShown("log_size_mean", born, shown, objects);

  std::vector<Observation> observations(boxes + positions);
  for (int row = 0; row < boxes; ++row) {
    Observation& observation = observations[row];
    observation.value = given.box.row(row).transpose();
    observation.sqrt_information =
        CheckedSqrtInformation<4>("box_covariance", given.covariance, row);
    observation.truncated = given.truncated.row(row);
  }
  for (int row = 0; row < positions; ++row) {
    observations[boxes + row].SetPosition(
        given.position.row(row).transpose(),
        CheckedSqrtInformation<3>("position_covariance", given.position_covariance, row));
  }
  for (int row = 0; row < boxes + positions; ++row) {
    observations[row].pose = pose;
    observations[row].object = shown[row];
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
  CheckUnitQuaternions("odometry", Pose::kModel, relative.transpose());
  typename History<Pose>::Step step;
  step.relative = relative;
  step.covariance.setIdentity();
  step.sqrt_information.setIdentity();
  step.first_observation = 0;
  if (first_is_known) return step;
  CheckTable("odometry_covariance", covariance, k, k);
  step.covariance = covariance;
  const RowMatrix row = step.covariance.reshaped().transpose();
  step.sqrt_information = CheckedSqrtInformation<k>("odometry_covariance", row, 0);
  return step;
}

template History<Se2>::Step CheckedStep<Se2>(const Eigen::VectorXd&, const RowMatrix&, bool);
template History<Se3>::Step CheckedStep<Se3>(const Eigen::VectorXd&, const RowMatrix&, bool);

}  // namespace dqslam::online
