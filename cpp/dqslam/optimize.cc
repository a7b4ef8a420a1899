#include "dqslam/optimize.h"

#include <ceres/problem.h>
#include <ceres/solver.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>

#include "dqslam/assembly.h"
#include "dqslam/dispatch.h"

namespace dqslam {
namespace {

// Debian's CHOLMOD opens OpenMP threads of its own, which cost more than they give at this size.  A
// Ceres without SuiteSparse factorises with Eigen, in one thread: the core is built without OpenMP.
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

// The almost undamped steps ahead of dog-leg.
constexpr double kFirstRadius = 1e8;
constexpr int kFirstIterations = 6;
constexpr double kFirstTolerance = 1e-5;

ceres::Solver::Options CeresOptions(const Stage& stage) {
  ceres::Solver::Options ceres_options;
  ceres_options.trust_region_strategy_type =
      stage.minimizer == Minimizer::kDogleg ? ceres::DOGLEG : ceres::LEVENBERG_MARQUARDT;
  ceres_options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  ceres_options.max_num_iterations = stage.max_iterations;
  ceres_options.function_tolerance = stage.function_tolerance;
  ceres_options.gradient_tolerance = 1e-12;
  ceres_options.parameter_tolerance = 1e-12;
  // An invalid step is a step into impossible geometry: shrink and go on.
  ceres_options.max_num_consecutive_invalid_steps = 50;
  ceres_options.num_threads = 1;
  ceres_options.logging_type = ceres::SILENT;
  return ceres_options;
}

Summary Summarize(const ceres::Solver::Summary& ceres_summary, const MonitorCallback& callback) {
  Summary summary;
  summary.seconds = ceres_summary.total_time_in_seconds;
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
  return summary;
}

Summary Minimize(ceres::Solver::Options ceres_options,
                 const Monitor& monitor,
                 ceres::Problem* problem) {
  MonitorCallback callback(monitor);
  ceres_options.callbacks.push_back(&callback);
  ceres::Solver::Summary ceres_summary;
  ceres::Solve(ceres_options, problem, &ceres_summary);
  if (callback.stopped) throw Interrupted();
  return Summarize(ceres_summary, callback);
}

// The box residual starts near its minimum.  Powell's dog-leg follows the bent valleys of objects
// whose tilt the boxes hardly determine, but Ceres' damps its Gauss-Newton step, which then creeps
// along the weakest modes of a long trajectory.  A few almost undamped steps take those first.
Summary PolishByDogleg(ceres::Solver::Options ceres_options,
                       const Monitor& monitor,
                       ceres::Problem* problem) {
  ceres::Solver::Options first_options = ceres_options;
  first_options.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  first_options.initial_trust_region_radius = kFirstRadius;
  first_options.max_num_iterations = std::min(kFirstIterations, ceres_options.max_num_iterations);
  first_options.function_tolerance = std::max(kFirstTolerance, ceres_options.function_tolerance);
  const Summary first = Minimize(first_options, monitor, problem);
  ceres_options.max_num_iterations -= first.iterations;
  if (ceres_options.max_num_iterations == 0 || !std::isfinite(first.final_cost)) return first;

  // In sigmas: a larger radius would only be halved step by step.
  ceres_options.initial_trust_region_radius = std::sqrt(problem->NumResiduals() + 1);
  Summary total = first;
  Append(Minimize(ceres_options, monitor, problem), &total);
  total.seconds += first.seconds;
  total.gradient_norm_start = first.gradient_norm_start;
  return total;
}

}  // namespace

Summary Optimize(const PreparedGraph& prepared,
                 const SolveOptions& options,
                 const Stage& stage,
                 const Monitor& monitor,
                 State* state) {
  [[maybe_unused]] const SingleOpenMpThread single_thread{};
  ceres::Problem problem;
  Assemble(prepared, options, stage, state, &problem);
  const bool polishes = stage.minimizer == Minimizer::kDogleg && stage.residual == Residual::kBox;
  Summary summary = polishes ? PolishByDogleg(CeresOptions(stage), monitor, &problem)
                             : Minimize(CeresOptions(stage), monitor, &problem);
  if (summary.rejected_steps > 0 && summary.rejected_steps == summary.iterations) {
    summary.converged = false;
    summary.message = "every step was rejected: " + summary.message;
  }
  return summary;
}

Eigen::VectorXd BoxCosts(const PreparedGraph& prepared,
                         const SolveOptions& options,
                         const State& state) {
  const Graph& graph = prepared.graph;
  Eigen::VectorXd costs(graph.boxes.size());
  Dispatch(graph.pose_model, options.landmark_model, [&](auto pose_model, auto landmark) {
    using Pose = decltype(pose_model);
    using Landmark = decltype(landmark);
    for (int row = 0; row < graph.boxes.size(); ++row) {
      const double* pose = state.poses.row(graph.boxes.pose[row]).data();
      const double* parameters = state.landmarks.row(graph.boxes.object[row]).data();
      Eigen::Vector4d predicted;
      const Surface<double> surface =
          ToCamera(LocateCamera<Pose>(pose, prepared.mount), Landmark::Unpack(parameters));
      const bool defined = ProjectToBox(surface, graph.camera, &predicted);
      Eigen::Vector4d error = predicted - graph.boxes.box.row(row).transpose();
      IgnoreBeyond(OneSidedEdges(prepared, row, surface), &error);
      costs[row] = defined ? 0.5 * (prepared.box_sqrt_information[row] * error).squaredNorm()
                           : std::numeric_limits<double>::infinity();
    }
  });
  return costs;
}

}  // namespace dqslam
