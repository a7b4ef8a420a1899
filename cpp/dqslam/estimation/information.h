// The information matrix H = J^T J of all whitened residuals at a state.  No Ceres here.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "dqslam/linear/block_cholesky.h"
#include "dqslam/linear/block_matrix.h"
#include "dqslam/solver/stage_terms.h"

namespace dqslam {

/// Columns: the tangents of the free poses in their order, then the parameters of all objects, then
/// the shared numbers.
struct Information {
  /// Rows: the residuals of odometry, then of boxes, then of all other terms, in sigmas.
  Eigen::SparseMatrix<double, Eigen::RowMajor> jacobian;
  BlockMatrix H{{}, {}};      ///< its blocks are those of the columns
  Eigen::VectorXd residuals;  ///< in sigmas, one for each row of the Jacobian
  int first_free_pose = 1;
  int num_free_poses = 0;
  int num_boxes = 0;  ///< the number of boxes among the residuals

  /// The block of a free pose or of an object.
  int PoseBlock(int pose) const { return pose - first_free_pose; }
  int ObjectBlock(int object) const { return num_free_poses + object; }
};

/// With a robust loss, boxes that are outliers at the state are left out.  Throws
/// std::invalid_argument for a state that does not fit the graph, and std::runtime_error where a
/// residual of the last stage is undefined at the state.
Information ComputeInformation(const Graph& graph, const SolveOptions& options, const State& state);

/// The terms behind the rows, in their order.
StageTerms InformationTerms(const Graph& graph, const SolveOptions& options, const State& state);

/// Factorizes H with 1e-12 of its diagonal added, so that it can be factorized even where a
/// direction is undetermined.  Throws std::runtime_error where it is not positive definite even
/// then.
BlockCholesky Factorize(const BlockMatrix& H);

}  // namespace dqslam
