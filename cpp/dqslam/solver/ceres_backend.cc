#include "dqslam/solver/ceres_backend.h"

#include <ceres/problem.h>
#include <ceres/solver.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include <algorithm>
#include <limits>

namespace dqslam {
namespace {

// Debian's CHOLMOD starts OpenMP threads of its own, which make problems of this size slower.  A
// Ceres without SuiteSparse factorizes with Eigen in one thread, as this core is built without
// OpenMP.
class SingleOpenMpThread {
#ifdef _OPENMP
 public:
  SingleOpenMpThread() : levels_(omp_get_max_active_levels()) { omp_set_max_active_levels(0); }
  ~SingleOpenMpThread() { omp_set_max_active_levels(levels_); }

 private:
  int levels_;
#endif
};

class MonitorCallback : public ceres::IterationCallback {
 public:
  explicit MonitorCallback(const Monitor& monitor) : monitor_(monitor) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& iteration) override {
    if (iteration.step_is_valid || iteration.iteration == 0) {
      last_gradient_norm = iteration.gradient_max_norm;
    }
    if (iteration.iteration == 0) first_gradient_norm = iteration.gradient_max_norm;
    if (!monitor_ || monitor_()) return ceres::SOLVER_CONTINUE;
    stopped = true;
    return ceres::SOLVER_ABORT;
  }

  bool stopped = false;
  double first_gradient_norm = 0, last_gradient_norm = 0;

 private:
  const Monitor& monitor_;
};

Summary Summarize(const ceres::Solver::Summary& ceres_summary, const MonitorCallback& callback) {
  Summary summary;
  summary.seconds = ceres_summary.total_time_in_seconds;
  summary.evaluation_seconds = ceres_summary.residual_evaluation_time_in_seconds +
                               ceres_summary.jacobian_evaluation_time_in_seconds;
  summary.linear_solver_seconds = ceres_summary.linear_solver_time_in_seconds;
  summary.message = ceres_summary.message;
  if (ceres_summary.termination_type == ceres::FAILURE && ceres_summary.iterations.empty()) {
    summary.initial_cost = summary.final_cost = std::numeric_limits<double>::infinity();
    summary.message = "a residual is undefined at the start: " + summary.message;
    return summary;
  }
  summary.initial_cost = ceres_summary.initial_cost;
  summary.final_cost = ceres_summary.final_cost;
  // Without variables, Ceres has no iterations and leaves the counts at -1.
  summary.iterations = std::max(static_cast<int>(ceres_summary.iterations.size()) - 1, 0);
  summary.rejected_steps = std::max(ceres_summary.num_unsuccessful_steps, 0);
  summary.gradient_norm_start = callback.first_gradient_norm;
  summary.gradient_norm_end = callback.last_gradient_norm;
  summary.converged = ceres_summary.termination_type == ceres::CONVERGENCE;
  // Ceres also calls it convergence where no step was good and the last one was short.
  if (summary.rejected_steps > 0 && summary.rejected_steps == summary.iterations) {
    summary.converged = false;
    summary.message = "every step was rejected: " + summary.message;
  }
  return summary;
}

}  // namespace

Summary MinimizeByCeres(const TrustRegionOptions& options,
                        const Monitor& monitor,
                        ceres::Problem* problem) {
  ceres::Solver::Options ceres_options;
  ceres_options.trust_region_strategy_type =
      options.minimizer == Minimizer::kDogleg ? ceres::DOGLEG : ceres::LEVENBERG_MARQUARDT;
  ceres_options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  ceres_options.max_num_iterations = options.max_iterations;
  ceres_options.function_tolerance = options.function_tolerance;
  ceres_options.gradient_tolerance = 1e-12;
  ceres_options.parameter_tolerance = 1e-12;
  // An invalid step leads into impossible geometry.  The solver shrinks the step and continues.
  ceres_options.max_num_consecutive_invalid_steps = 50;
  ceres_options.num_threads = 1;
  ceres_options.logging_type = ceres::SILENT;
  [[maybe_unused]] const SingleOpenMpThread single_thread{};
  MonitorCallback callback(monitor);
  ceres_options.callbacks.push_back(&callback);
  ceres::Solver::Summary ceres_summary;
  ceres::Solve(ceres_options, problem, &ceres_summary);
  if (callback.stopped) throw Interrupted();
  return Summarize(ceres_summary, callback);
}

}  // namespace dqslam
