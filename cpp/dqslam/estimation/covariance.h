// The uncertainty of an estimate: marginal covariances from the information matrix H = J^T J of all
// whitened residuals, in the tangent spaces of the poses and in the parameters of the objects.
//
// The gauge is the first pose, which is fixed.  Its covariance is zero, and all other covariances
// are relative to it.
#pragma once

#include <vector>

#include "dqslam/problem/graph.h"
#include "dqslam/problem/options.h"

namespace dqslam {

enum class VariableKind { kPose, kObject };

/// A parameter that neither the data nor the priors determine.
struct UnderConstrained {
  VariableKind kind;
  int row;        ///< row of the pose or the object in the graph
  int parameter;  ///< index of the parameter in the tangent of that pose or object
};

struct Covariance {
  RowMatrix poses;    ///< (poses, k * k) in the frames of the poses; NaN where under-constrained
  RowMatrix objects;  ///< (objects, 81) of the landmark parameters; NaN where under-constrained
  Eigen::VectorXd shared;  ///< variance of each shared number
  /// The first under-constrained parameter of each pose and object that has one.
  std::vector<UnderConstrained> under_constrained;
};

/// Marginal covariances at a state.  At the true state this is the posterior Cramer-Rao bound.
/// With a robust loss, boxes that are outliers at the state are left out.
/// In mapping mode all poses are fixed.  Throws std::invalid_argument for a state that does not fit
/// the graph, and std::runtime_error where a residual of the last stage is undefined at the state.
Covariance ComputeCovariance(const Graph& graph, const SolveOptions& options, const State& state);

/// Joint covariance of some poses and objects, in the given order: first k rows for the tangent of
/// each pose, then 9 rows for the parameters of each object.  It is zero for a fixed pose.
RowMatrix ComputeJointCovariance(const Graph& graph,
                                 const SolveOptions& options,
                                 const State& state,
                                 const std::vector<int>& poses,
                                 const std::vector<int>& objects);

/// How well the measurements of each group fit the estimate.  Variance components are estimated
/// from it.  The leverage of a measurement is 1 where it alone determines what it measures and 0
/// where the other measurements do.  The expected squared residual is 1 - leverage.
struct Fit {
  RowMatrix odometry_residuals;  ///< (edges, k) in sigmas
  RowMatrix odometry_leverage;   ///< (edges, k)
  double box_squares = 0;        ///< sum of squared residuals of all box edges, in sigmas
  double box_redundancy = 0;     ///< sum of 1 - leverage over the edges with a constraint
};

Fit ComputeFit(const Graph& graph, const SolveOptions& options, const State& state);

}  // namespace dqslam
