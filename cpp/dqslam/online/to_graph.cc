// A history as a problem for Solve().
#include <Eigen/LU>
#include <algorithm>

#include "dqslam/costs/measurements.h"
#include "dqslam/online/history.h"

namespace dqslam::online {
namespace {

// Observations of a kind, of objects that are in the graph.
std::vector<const Observation*> OfKind(const std::vector<Observation>& observations,
                                       const std::vector<int>& row_in_graph,
                                       int kind) {
  std::vector<const Observation*> found;
  for (const Observation& one : observations) {
    const bool takes_part = one.object >= 0 && row_in_graph[one.object] >= 0;
    if (takes_part && one.kind == kind) found.push_back(&one);
  }
  return found;
}

// Fills a table of the graph with observations of m numbers each.
template <typename Table>
void Fill(const std::vector<const Observation*>& observations,
          const std::vector<int>& row_in_graph,
          int m,
          Table* table,
          RowMatrix* values) {
  const Eigen::Index count = static_cast<Eigen::Index>(observations.size());
  table->pose.resize(count);
  table->object.resize(count);
  values->resize(count, m);
  table->covariance.resize(count, m * m);
  for (Eigen::Index row = 0; row < count; ++row) {
    const Observation& one = *observations[row];
    const Eigen::MatrixXd W = one.SqrtInformation().topLeftCorner(m, m);
    const Eigen::MatrixXd covariance = (W.transpose() * W).inverse();
    table->pose[row] = one.pose;
    table->object[row] = row_in_graph[one.object];
    values->row(row) = one.value.head(m).transpose();
    table->covariance.row(row) = covariance.reshaped().transpose();
  }
}

}  // namespace

template <typename Pose>
Graph History<Pose>::ToGraph(std::vector<int>* rows) const {
  constexpr int k = Pose::kTangentSize;
  Graph graph;
  graph.pose_model = Pose::kModel;
  graph.camera = model.camera;
  graph.scene_priors = model.scene;
  graph.initial_poses.resize(num_poses(), Pose::kSize);
  const int last = std::max(num_poses() - 1, 0);
  graph.odometry.from = IndexVector::LinSpaced(last, 0, last - 1);
  graph.odometry.to = IndexVector::LinSpaced(last, 1, last);
  graph.odometry.relative.resize(last, Pose::kSize);
  graph.odometry.covariance.resize(last, k * k);
  Storage reckoned;
  for (int pose = 0; pose < num_poses(); ++pose) {
    const Step& step = steps[pose];
    reckoned = pose > 0 ? Compose(reckoned, step.relative) : step.relative;
    graph.initial_poses.row(pose) = reckoned.transpose();
    if (pose == 0) continue;
    graph.odometry.relative.row(pose - 1) = step.relative.transpose();
    graph.odometry.covariance.row(pose - 1) =
        step.covariance.template reshaped<Eigen::RowMajor>().transpose();
  }
  const IndexVector boxes = BoxCounts();
  std::vector<int> row_in_graph(num_objects(), -1);
  rows->clear();
  for (int object = 0; object < num_objects(); ++object) {
    if (boxes[object] == 0) continue;
    row_in_graph[object] = static_cast<int>(rows->size());
    rows->push_back(object);
  }
  graph.size_prior.log_mean.resize(rows->size());
  graph.size_prior.log_sigma.resize(rows->size());
  for (size_t row = 0; row < rows->size(); ++row) {
    graph.size_prior.log_mean[row] = objects[(*rows)[row]].size.log_mean;
    graph.size_prior.log_sigma[row] = objects[(*rows)[row]].size.log_sigma;
  }
  const auto shown = OfKind(observations, row_in_graph, Observation::kBox);
  Fill(shown, row_in_graph, kBoxSize, &graph.boxes, &graph.boxes.box);
  graph.boxes.truncated.resize(graph.boxes.size(), kBoxSize);
  for (size_t row = 0; row < shown.size(); ++row) {
    graph.boxes.truncated.row(row) = shown[row]->truncated.transpose();
  }
  for (int kind = 0; kind < kNumMeasurementKinds; ++kind) {
    const auto measured = OfKind(observations, row_in_graph, kind);
    if (measured.empty()) continue;
    MeasurementTable& table = graph.measurements.emplace_back();
    table.kind = MeasurementName(kind);
    Fill(measured, row_in_graph, MeasurementSize(kind), &table, &table.value);
  }
  return graph;
}

template Graph History<Se2>::ToGraph(std::vector<int>*) const;
template Graph History<Se3>::ToGraph(std::vector<int>*) const;

}  // namespace dqslam::online
