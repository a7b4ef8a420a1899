// One stage of estimation: some poses, some boxes, one residual, one minimizer.
#pragma once

#include <vector>

#include "dqslam/problem/options.h"
#include "dqslam/problem/prepared.h"

namespace dqslam {

/// Whether a residual is one of the paper's, which only Ceres minimizes.
inline bool IsAlgebraic(Residual residual) {
  return residual == Residual::kAlgebraic || residual == Residual::kAlgebraicNormalized;
}

/// Which part of the graph takes part, and how.
struct Stage {
  int first_free_pose = 1;                 ///< poses before it are constant
  int end_pose = 0;                        ///< poses from it on take no part
  std::vector<int> boxes;                  ///< rows that take part; their objects do too
  std::vector<double> weights;             ///< of these boxes, in [0, 1]; empty: all 1
  Residual residual = Residual::kTangent;  ///< not kTangentThenBox
  Loss loss = Loss::kNone;                 ///< GNC: of the boxes' weights, not of this stage
  Minimizer minimizer = Minimizer::kDogleg;
  int max_iterations = 100;
  double function_tolerance = 1e-10;  ///< stop when |change of cost| / cost falls below
};

/// Minimizes from `state` and writes the result there, natively where that is possible: boxes and
/// tangents of ellipsoids.  Ceres minimizes what only the paper's method and switchable constraints
/// need, and everything with Backend::kCeres.  Where the box residual is undefined at the
/// start of the stage, that box uses the tangent residual.  Throws Interrupted.
Summary Optimize(const PreparedGraph& prepared,
                 const SolveOptions& options,
                 const Stage& stage,
                 const Monitor& monitor,
                 State* state);

/// Half the squared Mahalanobis distance of each box from its prediction; infinite where the object
/// is not strictly in front.
Eigen::VectorXd BoxCosts(const PreparedGraph& prepared,
                         const SolveOptions& options,
                         const State& state);

}  // namespace dqslam
