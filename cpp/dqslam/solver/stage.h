// One stage of estimation: it has some poses, some boxes, one residual and one minimizer.
#pragma once

#include <memory>
#include <vector>

#include "dqslam/linear/layout_cache.h"
#include "dqslam/problem/options.h"
#include "dqslam/problem/prepared.h"

namespace dqslam {

/// Whether a residual is one of the paper's.  Only Ceres minimizes these.
inline bool IsAlgebraic(Residual residual) {
  return residual == Residual::kAlgebraic || residual == Residual::kAlgebraicNormalized;
}

/// What all stages of a solve share.  What it refers to must outlive the context.
struct SolveContext {
  const PreparedGraph& prepared;
  const SolveOptions& options;
  const Monitor& monitor;
  /// Stages that follow each other mostly have the same terms.
  std::shared_ptr<LayoutCache> layouts = std::make_shared<LayoutCache>();

  const Graph& graph() const { return prepared.graph; }
};

/// The part of the graph that a stage uses, and how it is minimized.
struct Stage {
  int first_free_pose = 1;                 ///< poses before it are constant
  int end_pose = 0;                        ///< poses from this one on are not in the stage
  bool moves_shared = true;                ///< whether the shared numbers are free
  std::vector<int> boxes;                  ///< rows of the boxes in the stage, with their objects
  std::vector<double> weights;             ///< of these boxes, in [0, 1]; if empty, all are 1
  Residual residual = Residual::kTangent;  ///< any but kTangentThenBox
  Loss loss = Loss::kNone;                 ///< GNC changes the weights and acts as kNone here
  Minimizer minimizer = Minimizer::kDogleg;
  int max_iterations = 100;
  double function_tolerance = 1e-10;  ///< stops when |change of cost| / cost is at most this
};

/// Minimizes from `state` and writes the result there.  The native solver minimizes box and tangent
/// residuals of ellipsoids.  Ceres minimizes stages with algebraic residuals, dual quadrics or
/// switchable constraints, and every stage with Backend::kCeres.  A box whose box residual is
/// undefined at the start of the stage uses the tangent residual.  Throws Interrupted.
Summary Optimize(const SolveContext& context, const Stage& stage, State* state);

/// Half the squared Mahalanobis distance of each box from its prediction.  It is infinite where the
/// object is not strictly in front of the camera.
Eigen::VectorXd BoxCosts(const SolveContext& context, const State& state);
/// The same of some boxes, in the order of their rows.
Eigen::VectorXd BoxCosts(const SolveContext& context,
                         const State& state,
                         const std::vector<int>& rows);

}  // namespace dqslam
