// The information matrix H = J^T J of all whitened residuals at a state.  No Ceres here.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "dqslam/solver/stage.h"

namespace dqslam {

/// Columns: the tangents of the free poses in their order, then the parameters of all objects.
struct Information {
  Eigen::SparseMatrix<double>
      jacobian;  ///< of the residuals, in sigmas; of odometry, then boxes, then the rest
  Eigen::SparseMatrix<double> matrix;  ///< H
  Eigen::VectorXd residuals;
  std::vector<int> block_sizes;  ///< of the free poses and the objects
  int first_free_pose = 1;
  int num_free_poses = 0;
  int num_boxes = 0;  ///< that take part

  /// Column at which the block of a free pose or of an object starts.
  int PoseColumn(int pose) const;
  int ObjectColumn(int object) const;
};

/// With a robust loss, boxes that are outliers at the state take no part.  Throws
/// std::invalid_argument for a state that does not fit the graph and std::runtime_error where a
/// residual of the last stage is undefined at it.
Information ComputeInformation(const Graph& graph, const SolveOptions& options, const State& state);

/// H with a trillionth of its diagonal added, which keeps a factorization alive on
/// directions that nothing determines.
Eigen::SparseMatrix<double> Damped(const Eigen::SparseMatrix<double>& H);

}  // namespace dqslam
