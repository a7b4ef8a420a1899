// Levenberg-Marquardt for problems of a few unknowns, whose normal equations are one dense matrix.
#pragma once

#include <Eigen/Cholesky>
#include <limits>

namespace dqslam::online {

/// Takes at most `iterations` steps in n unknowns, with Marquardt's damping, and stops after a step
/// that lowers the cost by less than `tolerance` of it.  Returns the cost.
///   double linearize(state, H, g)         returns the cost, and sets J^T J and J^T r
///   bool retract(state, step, result)     returns false if the step is impossible
///   double cost_at(state)                 the cost with the residuals that linearize() used last
template <int n, typename State, typename Linearize, typename Retract, typename CostAt>
double LevenbergMarquardt(int iterations,
                          double tolerance,
                          State* state,
                          Linearize&& linearize,
                          Retract&& retract,
                          CostAt&& cost_at) {
  constexpr double kFirstDamping = 1e-3, kLess = 5, kMore = 10;
  double damping = kFirstDamping, cost = std::numeric_limits<double>::infinity();
  Eigen::Matrix<double, n, n> H;
  Eigen::Matrix<double, n, 1> g;
  bool has_moved = true;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    if (has_moved) cost = linearize(*state, &H, &g);
    Eigen::Matrix<double, n, n> damped = H;
    damped.diagonal() *= 1 + damping;
    const Eigen::Matrix<double, n, 1> step = -damped.ldlt().solve(g);
    State trial;
    const bool is_possible = step.allFinite() && retract(*state, step, &trial);
    const double after = is_possible ? cost_at(trial) : cost;
    has_moved = after < cost;
    if (!has_moved) {
      damping *= kMore;
      continue;
    }
    const bool is_done = cost - after < tolerance * cost;
    *state = trial;
    cost = after;
    damping /= kLess;
    if (is_done) break;
  }
  return cost;
}

}  // namespace dqslam::online
