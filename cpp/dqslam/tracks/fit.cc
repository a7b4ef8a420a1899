#include "dqslam/tracks/fit.h"

#include <algorithm>
#include <utility>

#include "dqslam/tracks/chain_factor.h"

namespace dqslam::tracks {
namespace {

// The cost is as low as it gets if a step lowers it by less.
constexpr double kTolerance = 1e-3;
constexpr double kFirstDamping = 1e-3, kLeastDamping = 1e-9, kMostDamping = 1e8;
constexpr double kLess = 0.2, kMore = 10;
// Sides change by a factor of e at most in a step.
constexpr double kMostGrowth = 1;

Trajectory Move(const Trajectory& at, const RowMatrix& step) {
  const Eigen::Index count = at.state.rows();
  Trajectory moved = at;
  moved.state += Eigen::Map<const StateTable>(step.data(), count, kStateSize);
  moved.log_half += step.bottomRows<3>().cwiseMax(-kMostGrowth).cwiseMin(kMostGrowth);
  return moved;
}

RowMatrix Downhill(const Equations& equations) {
  RowMatrix right(equations.gradient.size() + 3, 1);
  right << -equations.gradient.reshaped<Eigen::RowMajor>(), -equations.gradient_size;
  return right;
}

}  // namespace

std::optional<TrackFit> FitTrack(const TrackProblem& problem,
                                 const Trajectory& start,
                                 const Mask& moves,
                                 int max_iterations) {
  RequireFit(problem, start, moves);
  const State first = start.state.row(0);
  std::optional<Equations> equations = Linearize(problem, start, moves, first);
  if (!equations) return std::nullopt;
  TrackFit fit{start, std::move(*equations), 0, false};
  double damping = kFirstDamping;
  for (int iteration = 0; iteration < max_iterations && !fit.converged; ++iteration) {
    const std::optional<ChainFactor> factor = ChainFactor::Make(fit.equations, damping);
    if (!factor) {
      damping *= kMore;
      continue;
    }
    Trajectory next = Move(fit.trajectory, factor->Solve(Downhill(fit.equations)));
    equations = Linearize(problem, next, moves, first);
    if (!equations || !(equations->cost < fit.equations.cost)) {
      fit.converged = damping > kMostDamping;  // no step leads further down
      damping *= kMore;
      continue;
    }
    fit.converged = fit.equations.cost - equations->cost < kTolerance;
    fit.trajectory = std::move(next);
    fit.equations = std::move(*equations);
    damping = std::max(kLess * damping, kLeastDamping);
  }
  const std::optional<ChainFactor> factor = ChainFactor::Make(fit.equations);
  if (!factor) return std::nullopt;
  fit.log_evidence =
      fit.equations.log_density - fit.equations.cost - 0.5 * factor->LogDeterminant();
  return fit;
}

}  // namespace dqslam::tracks
