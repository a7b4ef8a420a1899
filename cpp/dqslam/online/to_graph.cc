// A history as a problem for Solve().
#include <Eigen/LU>
#include <algorithm>

#include "dqslam/online/history.h"

namespace dqslam::online {
namespace {

// Fills a table of boxes (n = 4) or positions (n = 3) with what a history has of them.
template <int n, typename Table>
void Fill(const std::vector<Observation>& observations,
          const std::vector<int>& row_in_graph,
          Table* table,
          RowMatrix* values) {
  std::vector<const Observation*> own;
  for (const Observation& one : observations) {
    const bool takes_part = !one.Waits() && row_in_graph[one.object] >= 0;
    if (takes_part && one.is_box == (n == kBoxSize)) own.push_back(&one);
  }
  table->pose.resize(own.size());
  table->object.resize(own.size());
  values->resize(own.size(), n);
  table->covariance.resize(own.size(), n * n);
  for (size_t row = 0; row < own.size(); ++row) {
    const Eigen::Matrix<double, n, n> W = own[row]->sqrt_information.template topLeftCorner<n, n>();
    const Eigen::Matrix<double, n, n> covariance = (W.transpose() * W).inverse();
    table->pose[row] = own[row]->pose;
    table->object[row] = row_in_graph[own[row]->object];
    values->row(row) = own[row]->value.template head<n>().transpose();
    table->covariance.row(row) = covariance.reshaped().transpose();
    if constexpr (n == kBoxSize) table->truncated.row(row) = own[row]->truncated.transpose();
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
  graph.boxes.truncated.resize(boxes.sum(), kBoxSize);
  Fill<kBoxSize>(observations, row_in_graph, &graph.boxes, &graph.boxes.box);
  Fill<3>(observations, row_in_graph, &graph.positions, &graph.positions.object_in_robot);
  return graph;
}

template Graph History<Se2>::ToGraph(std::vector<int>*) const;
template Graph History<Se3>::ToGraph(std::vector<int>*) const;

}  // namespace dqslam::online
