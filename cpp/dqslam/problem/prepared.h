// A validated graph with what is derived from it once per solve: whitening and adjacency.
#pragma once

#include <vector>

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/problem/graph.h"

namespace dqslam {

struct PreparedGraph {
  /// Validates; throws std::invalid_argument.  The graph must outlive the result.
  PreparedGraph(const Graph& graph, bool poses_known);

  const Graph& graph;
  Mount mount;
  std::vector<Eigen::MatrixXd> odometry_sqrt_information;  ///< k x k, one an odometry row
  std::vector<Eigen::Matrix4d> box_sqrt_information;
  std::vector<int> measurement_kinds;                   ///< one a table, see costs/measurements.h
  std::vector<RowMatrix> measurement_sqrt_information;  ///< one a table, m * m a row
  std::vector<std::vector<int>> boxes_of_object;        ///< box rows in the order of their poses
  std::vector<int> odometry_into;                       ///< row that leads to each pose; -1: none
};

/// Those of a box of the graph, see ellipsoid.h; where its object is not strictly in front, the
/// edges that the image border cut.
EdgeFlags OneSidedEdges(const PreparedGraph& prepared, int box, const Surface<double>& in_camera);

/// Where the camera stands at a pose of the state.
CameraInWorld<double> LocateCamera(const PreparedGraph& prepared, const State& state, int pose);

/// Poses from `begin` on become the chain of odometry behind the poses before them.
void DeadReckon(const PreparedGraph& prepared, int begin, int end, State* state);

}  // namespace dqslam
