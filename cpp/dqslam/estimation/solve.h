// The solver, from a graph to an estimate.  Its input and output are plain data.
#pragma once

#include <optional>
#include <vector>

#include "dqslam/problem/graph.h"
#include "dqslam/problem/options.h"

namespace dqslam {

struct Solution {
  RowMatrix poses;                ///< (poses, d)
  RowMatrix landmarks;            ///< (objects, 9) parameters of the landmark model
  std::vector<Shape> shapes;      ///< of the objects; if empty, all are in the landmark model
  RowMatrix dual_quadrics;        ///< (objects, 9) q1 .. q9, for both landmark models; that of
                                  ///< the equivalent ellipsoid for cuboids and cylinders
  RowMatrix svd_singular_values;  ///< (objects, 10) of the SVD starts; NaN where not used
  Eigen::VectorXd shared;         ///< the shared numbers of the graph
  Mask inliers;                   ///< (boxes) chi-square is at most options.outlier_chi_square
  Summary summary;
};

/// Solves from the odometry, or from `start` if it is given.  The landmarks of `start` are
/// parameters of the landmark model in the options. Throws std::invalid_argument for bad input and
/// Interrupted when the monitor asks to stop.
Solution Solve(const Graph& graph,
               const SolveOptions& options,
               const std::optional<State>& start = std::nullopt,
               const Monitor& monitor = nullptr);

}  // namespace dqslam
