#include "dqslam/online/checked.h"

#include "dqslam/costs/measurements.h"
#include "dqslam/problem/checks.h"

namespace dqslam::online {
namespace {

void CheckObservations(const StepObservations& given, int objects) {
  const Eigen::Index born = given.log_size_mean.size();
  CheckIds("box_object", given.object, given.box.rows(), objects + born, -1);
  CheckBoxes(given.box, given.covariance, given.truncated, given.box.rows());
  CheckSizePriors(given.log_size_mean, given.log_size_sigma, born);
  IndexVector shown = given.object;
  for (const MeasurementTable& table : given.measurements) {
    CheckMeasurements(table, table.value.rows(), objects + born);
    if (table.kind != "position") continue;  // alone, no other kind says where a new object is
    const Eigen::Index before = shown.size();
    shown.conservativeResize(before + table.object.size());
    shown.tail(table.object.size()) = table.object;
  }
  CheckShown("log_size_mean", born, shown, objects);
}

}  // namespace

std::vector<Observation> CheckedObservations(const StepObservations& given, int pose, int objects) {
  CheckObservations(given, objects);
  std::vector<Observation> observations;
  for (int row = 0; row < given.object.size(); ++row) {
    Observation& box = observations.emplace_back();
    box.object = given.object[row];
    box.value = given.box.row(row).transpose();
    box.SetSqrtInformation(SqrtInformationOfRow<4>("box_covariance", given.covariance, row));
    box.truncated = given.truncated.row(row);
  }
  for (const MeasurementTable& table : given.measurements) {
    const int kind = MeasurementKind(table.kind);
    for (int row = 0; row < table.object.size(); ++row) {
      Observation& measured = observations.emplace_back();
      measured.object = table.object[row];
      measured.SetMeasurement(kind,
                              table.value.row(row).transpose(),
                              MeasurementSqrtInformation(kind, table.covariance.row(row).data()));
    }
  }
  for (Observation& observation : observations) observation.pose = pose;
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
  step.sqrt_information = SqrtInformationOfRow<k>("odometry_covariance", row, 0);
  return step;
}

template History<Se2>::Step CheckedStep<Se2>(const Eigen::VectorXd&, const RowMatrix&, bool);
template History<Se3>::Step CheckedStep<Se3>(const Eigen::VectorXd&, const RowMatrix&, bool);

}  // namespace dqslam::online
