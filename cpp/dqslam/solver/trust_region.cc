#include "dqslam/solver/trust_region.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>

#include "dqslam/solver/strategy.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

constexpr double kSmallestRadius = 1e-32;
constexpr double kSufficientDecrease = 1e-3;  // of the decrease that the model predicts
constexpr double kTinyStep = 1e-12;           // relative to the values
constexpr double kTinyGradient = 1e-12;
// Where steps have become tiny, the model must not promise a larger decrease than this, as a share
// of the cost (of 1 for a cost below 1, which is in squared sigmas).
constexpr double kBrokenPromise = 1e-3;
// An invalid step leads into impossible geometry.  The trust region shrinks and the loop continues.
constexpr int kMaxInvalidSteps = 50;

// Adds the time between its construction and its destruction to a counter.
class Stopwatch {
 public:
  explicit Stopwatch(double* seconds) : seconds_(*seconds) {}
  ~Stopwatch() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

// The values and the cost after a step.
class Trial {
 public:
  explicit Trial(const LeastSquares& problem) : problem_(problem) {}

  // Takes the straight step. If its decrease is poor compared with the one that the model predicts,
  // tries the step along the path as well and takes the better one. Returns the decrease, which is
  // minus infinity where a residual is undefined.
  double Take(const VectorXd& values, const VectorXd& step, double predicted) {
    const double before = problem_.equations().cost;
    cost_ = CostOf(problem_.Retract(values, step, &reached_), reached_);
    if (!(before - cost_ > kPoorGain * predicted)) {
      const double along_path =
          CostOf(problem_.RetractAlongPath(values, step, &along_path_), along_path_);
      if (along_path < cost_) {
        cost_ = along_path;
        reached_.swap(along_path_);
      }
    }
    return before - cost_;
  }
  double cost() const { return cost_; }
  VectorXd& reached() { return reached_; }

 private:
  double CostOf(bool possible, const VectorXd& values) const {
    double cost = 0;
    return possible && problem_.Cost(values, &cost) ? cost
                                                    : std::numeric_limits<double>::infinity();
  }

  const LeastSquares& problem_;
  VectorXd reached_, along_path_;
  double cost_ = 0;
};

std::string Message(const char* what, double value, const char* relation, double limit) {
  std::ostringstream message;
  message << what << ": " << value << ' ' << relation << ' ' << limit;
  return message.str();
}

double LargestOf(const VectorXd& vector) {
  return vector.size() == 0 ? 0 : vector.lpNorm<Eigen::Infinity>();
}

}  // namespace

Summary Minimize(const TrustRegionOptions& options,
                 const Monitor& monitor,
                 LeastSquares* least_squares,
                 VectorXd* values) {
  Summary summary;
  const Stopwatch total(&summary.seconds);
  LeastSquares& problem = *least_squares;
  const NormalEquations& equations = problem.equations();
  bool defined = false;
  {
    const Stopwatch evaluation(&summary.evaluation_seconds);
    defined = problem.Linearize(*values);
  }
  if (!defined || !std::isfinite(equations.cost)) {
    summary.initial_cost = summary.final_cost = std::numeric_limits<double>::infinity();
    summary.message = "a residual is undefined at the start";
    return summary;
  }
  summary.initial_cost = summary.final_cost = equations.cost;
  summary.gradient_norm_start = summary.gradient_norm_end = LargestOf(equations.gradient);
  const auto converge = [&summary](std::string message) {
    summary.converged = true;
    summary.message = std::move(message);
  };
  if (summary.gradient_norm_start <= kTinyGradient) {
    converge(Message("gradient", summary.gradient_norm_start, "<=", kTinyGradient));
    return summary;
  }

  std::unique_ptr<Strategy> strategy;
  {
    const Stopwatch linear_solver(&summary.linear_solver_seconds);
    strategy = MakeStrategy(options.minimizer, problem.LayOut(), options.threads);
  }
  // Stops because no step is short enough.  That is a minimum only if the model sees no decrease.
  const auto stop_short = [&](std::string message) {
    VectorXd full;
    const Stopwatch linear_solver(&summary.linear_solver_seconds);
    const bool has_step = strategy->StepWithoutLimit(equations, &full);
    const double promise = has_step ? -0.5 * full.dot(equations.gradient) : 0;
    if (has_step && promise <= kBrokenPromise * std::max(equations.cost, 1.0)) {
      converge(std::move(message));
    } else {
      summary.message =
          Message("jammed: a decrease of", promise, "is left at cost", equations.cost);
    }
  };
  VectorXd step;
  Trial trial(problem);
  bool is_new = true;
  int invalid_steps = 0;
  while (!summary.converged) {
    if (monitor && !monitor()) throw Interrupted();
    if (summary.iterations == options.max_iterations) {
      summary.message = "stopped after " + std::to_string(options.max_iterations) + " iterations";
      break;
    }
    if (strategy->radius() < kSmallestRadius) {
      stop_short(Message("trust region", strategy->radius(), "<", kSmallestRadius));
      break;
    }
    ++summary.iterations;
    double predicted = 0;
    {
      const Stopwatch linear_solver(&summary.linear_solver_seconds);
      predicted = strategy->Step(equations, is_new, &step);
    }
    is_new = false;
    if (!(predicted > 0)) {
      ++summary.rejected_steps;
      strategy->RejectInvalid();
      if (++invalid_steps < kMaxInvalidSteps) continue;
      summary.message = "no valid step was found";
      break;
    }
    invalid_steps = 0;
    if (step.norm() <= kTinyStep * (values->norm() + kTinyStep)) {
      stop_short(Message("step", step.norm(), "<=", kTinyStep * values->norm()));
      break;
    }

    const Stopwatch evaluation(&summary.evaluation_seconds);
    const double decrease = trial.Take(*values, step, predicted);
    if (!strategy->IsLimited() && predicted <= kBrokenPromise * std::max(equations.cost, 1.0) &&
        std::abs(decrease) <= options.function_tolerance * equations.cost) {
      converge(Message(
          "relative change of cost", decrease / equations.cost, "<=", options.function_tolerance));
    }
    if (!(decrease > kSufficientDecrease * predicted)) {
      ++summary.rejected_steps;
      strategy->Reject();
      continue;
    }
    strategy->Accept(decrease / predicted);
    values->swap(trial.reached());
    summary.final_cost = trial.cost();
    if (summary.converged) break;  // Derivatives at the end are not needed.
    problem.Linearize(*values);
    is_new = true;
    summary.gradient_norm_end = LargestOf(equations.gradient);
    if (summary.gradient_norm_end <= kTinyGradient) {
      converge(Message("gradient", summary.gradient_norm_end, "<=", kTinyGradient));
    }
  }
  return summary;
}

}  // namespace dqslam
