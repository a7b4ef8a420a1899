#include "dqslam/trust_region.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>

#include "dqslam/block_cholesky.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

// The constants are those of Ceres, but for two.  Its trust region grows threefold at most.  And it
// damps dog-leg's Gauss-Newton step by 1e-8 of the curvature, which then creeps along the weakest
// modes of a trajectory of 50 000 poses.
constexpr double kSmallestScale = 1e-6, kLargestScale = 1e32;
constexpr double kSmallestRadius = 1e-32, kLargestRadius = 1e16;
constexpr double kDampedRadius = 1e4;         // where Levenberg-Marquardt starts
constexpr double kFastestGrowth = 10;         // of the radius, in one step
constexpr double kSufficientDecrease = 1e-3;  // of the decrease that the model predicts
constexpr double kTinyStep = 1e-12;           // relative to the values
constexpr double kTinyGradient = 1e-12;
constexpr double kLeastDamping = 1e-14, kMostDamping = 1;
// An invalid step is a step into impossible geometry: shrink and go on.
constexpr int kMaxInvalidSteps = 50;

// Adds the time of its life to a counter.
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

// How far to go, and where.
class Strategy {
 public:
  Strategy(const BlockMatrix& H, double radius) : radius_(radius), cholesky_(H) {}
  virtual ~Strategy() = default;
  // The step for equations that have not changed since the last call unless is_new; false where
  // there is none.
  virtual bool Step(const NormalEquations& equations, bool is_new, VectorXd* step) = 0;
  virtual void Accept(double gain_ratio) = 0;
  virtual void Reject() = 0;
  virtual void RejectInvalid() = 0;
  // Whether the trust region cut the step: then a small change of cost says nothing.
  virtual bool IsLimited() const { return false; }
  double radius() const { return radius_; }

 protected:
  // Squared scale of each variable: the curvature, within limits that are relative to the first.
  VectorXd Curvature(const NormalEquations& equations) {
    const VectorXd diagonal = equations.H.diagonal();
    if (first_scale_.size() == 0) {
      first_scale_ = (1 + diagonal.array().sqrt()).inverse().square();
    }
    return (diagonal.array() * first_scale_.array())
        .max(kSmallestScale)
        .min(kLargestScale)
        .matrix()
        .cwiseQuotient(first_scale_);
  }

  bool Solve(const NormalEquations& equations, const VectorXd& damping, VectorXd* step) {
    if (!cholesky_.Factorize(equations.H, damping)) return false;
    *step = cholesky_.Solve(-equations.gradient);
    return step->allFinite();
  }

  double radius_;

 private:
  BlockCholesky cholesky_;
  VectorXd first_scale_;
};

class LevenbergMarquardt : public Strategy {
 public:
  using Strategy::Strategy;

  bool Step(const NormalEquations& equations, bool is_new, VectorXd* step) override {
    if (is_new) curvature_ = Curvature(equations);
    return Solve(equations, curvature_ / radius_, step);
  }
  void Accept(double gain_ratio) override {
    const double growth = 1 - std::pow(2 * gain_ratio - 1, 3);
    radius_ = std::min(radius_ / std::max(1 / kFastestGrowth, growth), kLargestRadius);
    shrinkage_ = 2;
  }
  void Reject() override {
    radius_ /= shrinkage_;
    shrinkage_ *= 2;
  }
  void RejectInvalid() override { Reject(); }

 private:
  VectorXd curvature_;
  double shrinkage_ = 2;
};

// Powell's: where the whole Gauss-Newton step fails, shorter ones cost no further factorisation.
class Dogleg : public Strategy {
 public:
  using Strategy::Strategy;

  bool Step(const NormalEquations& equations, bool is_new, VectorXd* step) override {
    if (is_new || stale_) {
      scale_ = Curvature(equations).cwiseSqrt();
      gradient_ = equations.gradient.cwiseQuotient(scale_);
      const VectorXd uphill = gradient_.cwiseQuotient(scale_);
      cauchy_ = gradient_.squaredNorm() / uphill.dot(equations.H.Multiply(uphill));
      if (!FindGaussNewton(equations)) return false;
      stale_ = false;
    }
    *step = Within().cwiseQuotient(scale_);
    return true;
  }
  void Accept(double gain_ratio) override {
    if (gain_ratio < 0.25) radius_ *= 0.5;
    if (gain_ratio > 0.75) radius_ = std::max(radius_, 3 * step_norm_);
    damping_ = std::max(kLeastDamping, 0.2 * damping_);
  }
  bool IsLimited() const override { return gauss_newton_.norm() > radius_; }
  void Reject() override { radius_ = 0.5 * step_norm_; }
  void RejectInvalid() override {
    damping_ *= 10;
    stale_ = true;
  }

 private:
  bool FindGaussNewton(const NormalEquations& equations) {
    for (; damping_ < kMostDamping; damping_ *= 10) {
      if (Solve(equations, damping_ * scale_.cwiseAbs2(), &gauss_newton_)) {
        gauss_newton_.array() *= scale_.array();
        return true;
      }
    }
    return false;
  }

  // The point of the dog-leg path at the radius, scaled.
  VectorXd Within() {
    if (gauss_newton_.norm() <= radius_) {
      step_norm_ = gauss_newton_.norm();
      return gauss_newton_;
    }
    step_norm_ = radius_;
    const VectorXd downhill = -cauchy_ * gradient_;
    if (downhill.norm() >= radius_) return downhill * (radius_ / downhill.norm());
    const VectorXd leg = gauss_newton_ - downhill;
    const double a = leg.squaredNorm(), b = downhill.dot(leg);
    const double c = radius_ * radius_ - downhill.squaredNorm();
    const double root = std::sqrt(b * b + a * c);
    return downhill + (b <= 0 ? (root - b) / a : c / (b + root)) * leg;
  }

  VectorXd scale_, gradient_, gauss_newton_;
  double cauchy_ = 0, damping_ = kLeastDamping, step_norm_ = 0;
  bool stale_ = false;
};

std::unique_ptr<Strategy> MakeStrategy(Minimizer minimizer, const BlockMatrix& H) {
  if (minimizer == Minimizer::kDogleg) return std::make_unique<Dogleg>(H, kLargestRadius);
  return std::make_unique<LevenbergMarquardt>(H, kDampedRadius);
}

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
    strategy = MakeStrategy(options.minimizer, equations.H);
  }
  VectorXd step, candidate;
  bool is_new = true;
  int invalid_steps = 0;
  while (!summary.converged) {
    if (monitor && !monitor()) throw Interrupted();
    if (summary.iterations == options.max_iterations) {
      summary.message = "stopped after " + std::to_string(options.max_iterations) + " iterations";
      break;
    }
    if (strategy->radius() < kSmallestRadius) {
      converge(Message("trust region", strategy->radius(), "<", kSmallestRadius));
      break;
    }
    ++summary.iterations;
    double predicted = 0;
    {
      const Stopwatch linear_solver(&summary.linear_solver_seconds);
      if (strategy->Step(equations, is_new, &step)) {
        predicted = -step.dot(equations.gradient + 0.5 * equations.H.Multiply(step));
      }
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
      converge(Message("step", step.norm(), "<=", kTinyStep * values->norm()));
      break;
    }

    const Stopwatch evaluation(&summary.evaluation_seconds);
    double cost = 0;
    const bool possible = problem.Plus(*values, step, &candidate) && problem.Cost(candidate, &cost);
    const double decrease =
        possible ? equations.cost - cost : -std::numeric_limits<double>::infinity();
    if (!strategy->IsLimited() &&
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
    values->swap(candidate);
    summary.final_cost = cost;
    if (summary.converged) break;  // the derivatives there are not needed
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
