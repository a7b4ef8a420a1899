// A validated graph with data that is derived from it once per solve: whitening and adjacency.
#pragma once

#include <vector>

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/problem/graph.h"

namespace dqslam {

struct PreparedGraph {
  /// Validates the graph, which throws std::invalid_argument.  The graph must outlive the result.
  PreparedGraph(const Graph& graph, bool poses_known);

  const Graph& graph;
  Mount mount;
  std::vector<Eigen::MatrixXd> odometry_sqrt_information;  ///< k x k for each odometry row
  std::vector<Eigen::Matrix4d> box_sqrt_information;       ///< one for each box row
  std::vector<int> measurement_kinds;  ///< the kind of each table, see costs/measurements.h
  std::vector<RowMatrix> measurement_sqrt_information;  ///< (n, m * m) for each table
  std::vector<std::vector<int>> boxes_of_object;        ///< box rows in the order of their poses
  std::vector<int> odometry_into;  ///< the odometry row that leads to each pose, or -1
};

/// The camera at a pose of the state.
CameraInWorld<double> LocateCamera(const PreparedGraph& prepared, const State& state, int pose);

/// Replaces the poses from `begin` to `end` by odometry that continues from the poses before them.
void DeadReckon(const PreparedGraph& prepared, int begin, int end, State* state);

}  // namespace dqslam
