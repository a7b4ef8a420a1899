#include "dqslam/problem/graph.h"

#include <iomanip>
#include <sstream>

namespace dqslam {

void Append(const Summary& stage, Summary* total) {
  const Summary before = *total;
  *total = stage;
  total->iterations += before.iterations;
  total->rejected_steps += before.rejected_steps;
  total->seconds += before.seconds;
  total->start_seconds += before.start_seconds;
  total->evaluation_seconds += before.evaluation_seconds;
  total->linear_solver_seconds += before.linear_solver_seconds;
  if (!before.message.empty()) total->initial_cost = before.initial_cost;
}

std::string ToString(const Summary& summary) {
  std::ostringstream text;
  text << std::setprecision(6) << (summary.converged ? "converged" : "did not converge")
       << ": cost " << summary.initial_cost << " -> " << summary.final_cost << " in "
       << summary.iterations << " iterations (" << summary.rejected_steps << " steps rejected), "
       << std::setprecision(3) << summary.seconds << " s; gradient " << summary.gradient_norm_start
       << " -> " << summary.gradient_norm_end << "; " << summary.message;
  return text.str();
}

}  // namespace dqslam
