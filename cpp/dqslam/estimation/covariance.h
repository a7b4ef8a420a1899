// How uncertain an estimate is: marginal covariances from the information matrix H = J^T J of all
// whitened residuals, in the tangent spaces of the poses and the parameters of the objects.
//
// Gauge: the first pose is fixed, so that its covariance is zero and all others are relative to it.
#pragma once

#include <vector>

#include "dqslam/problem/graph.h"
#include "dqslam/problem/options.h"

namespace dqslam {

/// A parameter that neither the data nor the priors determine.
struct UnderConstrained {
  enum class Kind { kPose, kObject };
  Kind kind;
  int row;        ///< of the pose or the object in the graph
  int parameter;  ///< of its tangent
};

struct Covariance {
  RowMatrix poses;    ///< (poses, k * k) in the frames of the poses; NaN where under-constrained
  RowMatrix objects;  ///< (objects, 81) of the landmark parameters; NaN where under-constrained
  std::vector<UnderConstrained> under_constrained;  ///< the first parameter of each block
};

/// Marginal covariances at a state.  At the true state this is the posterior Cramer-Rao bound.
/// With a robust loss, boxes that are outliers at the state take no part.
/// In mapping mode all poses are fixed.  Throws std::invalid_argument for a state that does not fit
/// and std::runtime_error where a residual of the last stage is undefined at it.
Covariance ComputeCovariance(const Graph& graph, const SolveOptions& options, const State& state);

/// Joint covariance of some poses and objects, in the order given: their tangents, then their
/// landmark parameters, each k or 9 rows.  Zero for a fixed pose.
RowMatrix ComputeJointCovariance(const Graph& graph,
                                 const SolveOptions& options,
                                 const State& state,
                                 const std::vector<int>& poses,
                                 const std::vector<int>& objects);

/// How well measurements fit the estimate, by groups: what variance components are estimated from.
/// Leverage is 1 where a measurement alone determines what it measures, 0 where the others do; a
/// squared residual is 1 - leverage in the mean.
struct Fit {
  RowMatrix odometry_residuals;  ///< (edges, k) in sigmas
  RowMatrix odometry_leverage;   ///< (edges, k)
  double box_squares = 0;        ///< sum of squared residuals of all box edges, in sigmas
  double box_redundancy = 0;     ///< sum of 1 - leverage, of the edges that constrain anything
};

Fit ComputeFit(const Graph& graph, const SolveOptions& options, const State& state);

}  // namespace dqslam
