#include "dqslam/online/to_graph.h"

#include <algorithm>

namespace dqslam::online {

template <typename Pose>
Graph ToGraph(const Model& model, const History<Pose>& history, std::vector<int>* rows) {
  constexpr int k = Pose::kTangentSize;
  using Storage = typename History<Pose>::Storage;
  const int poses = history.num_poses(), objects = static_cast<int>(history.objects.size());
  Graph graph;
  graph.pose_model = Pose::kModel;
  graph.camera = model.camera;
  graph.scene_priors = model.scene;
  graph.initial_poses.resize(poses, Pose::kSize);
  const int steps = std::max(poses - 1, 0);
  graph.odometry.from = IndexVector::LinSpaced(steps, 0, steps - 1);
  graph.odometry.to = IndexVector::LinSpaced(steps, 1, steps);
  graph.odometry.relative.resize(steps, Pose::kSize);
  graph.odometry.covariance.resize(steps, k * k);
  for (int pose = 0; pose < poses; ++pose) {
    const auto& step = history.steps[pose];
    Storage at = step.relative;
    if (pose > 0) {
      Pose::Compose(graph.initial_poses.row(pose - 1).data(), step.relative.data(), at.data());
      Pose::Normalize(at.data());
      graph.odometry.relative.row(pose - 1) = step.relative.transpose();
      Eigen::Map<Eigen::Matrix<double, k, k, Eigen::RowMajor>>(
          graph.odometry.covariance.row(pose - 1).data()) = step.covariance;
    }
    graph.initial_poses.row(pose) = at.transpose();
  }
  rows->clear();
  std::vector<int> row_of_object(objects, -1);
  for (int object = 0; object < objects; ++object) {
    const std::vector<int>& own = history.objects[object].observations;
    const bool has_box = std::any_of(
        own.begin(), own.end(), [&](int row) { return history.observations[row].is_box; });
    if (!has_box) continue;
    row_of_object[object] = static_cast<int>(rows->size());
    rows->push_back(object);
  }
  graph.size_prior.log_mean.resize(rows->size());
  graph.size_prior.log_sigma.resize(rows->size());
  for (size_t row = 0; row < rows->size(); ++row) {
    graph.size_prior.log_mean[row] = history.objects[(*rows)[row]].size.log_mean;
    graph.size_prior.log_sigma[row] = history.objects[(*rows)[row]].size.log_sigma;
  }
  const auto takes_part = [&](const Observation& observation) {
    return !observation.Waits() && row_of_object[observation.object] >= 0;
  };
  int boxes = 0, positions = 0;
  for (const Observation& observation : history.observations) {
    if (takes_part(observation)) ++(observation.is_box ? boxes : positions);
  }
  graph.boxes = {IndexVector(boxes),
                 IndexVector(boxes),
                 RowMatrix(boxes, kBoxSize),
                 RowMatrix(boxes, 16),
                 BoolTable(boxes, kBoxSize)};
  graph.measurements = {{"position",
                         IndexVector(positions),
                         IndexVector(positions),
                         RowMatrix(positions, 3),
                         RowMatrix(positions, 9)}};
  boxes = positions = 0;
  for (const Observation& observation : history.observations) {
    if (!takes_part(observation)) continue;
    const int object = row_of_object[observation.object];
    if (observation.is_box) {
      const Eigen::Matrix4d& W = observation.sqrt_information;
      const Eigen::Matrix4d covariance = (W.transpose() * W).inverse();
      graph.boxes.pose[boxes] = observation.pose;
      graph.boxes.object[boxes] = object;
      graph.boxes.box.row(boxes) = observation.value.transpose();
      graph.boxes.covariance.row(boxes) =
          Eigen::Map<const Eigen::Matrix<double, 1, 16>>(covariance.data());
      graph.boxes.truncated.row(boxes++) = observation.truncated.transpose();
    } else {
      const Eigen::Matrix3d W = observation.sqrt_information.topLeftCorner<3, 3>();
      const Eigen::Matrix3d covariance = (W.transpose() * W).inverse();
      graph.measurements[0].pose[positions] = observation.pose;
      graph.measurements[0].object[positions] = object;
      graph.measurements[0].value.row(positions) = observation.value.head<3>().transpose();
      graph.measurements[0].covariance.row(positions++) =
          Eigen::Map<const Eigen::Matrix<double, 1, 9>>(covariance.data());
    }
  }
  return graph;
}

template Graph ToGraph<Se2>(const Model&, const History<Se2>&, std::vector<int>*);
template Graph ToGraph<Se3>(const Model&, const History<Se3>&, std::vector<int>*);

}  // namespace dqslam::online
