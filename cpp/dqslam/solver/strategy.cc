#include "dqslam/solver/strategy.h"

#include <algorithm>
#include <cmath>

namespace dqslam {
namespace {

using Eigen::VectorXd;

// The decrease of the cost that the model predicts for the step s of (H + D) s = -g, namely
// -g^T s - s^T H s / 2.  The equation itself gives H s.
double DecreaseOf(const NormalEquations& equations, const VectorXd& damping, const VectorXd& step) {
  return 0.5 * step.dot(damping.cwiseProduct(step) - equations.gradient);
}

// The constants are those of Ceres, except for two.  In Ceres, the trust region grows at most
// threefold in a step.  Ceres also damps the Gauss-Newton step of dog-leg by 1e-8 of the curvature,
// which makes progress slow along the weakest modes of a long path: at 200 000 poses, their
// curvature is only 3e-15 of the largest.
constexpr double kSmallestScale = 1e-6, kLargestScale = 1e32;
constexpr double kLargestRadius = 1e16;
constexpr double kDampedRadius = 1e4;  // the first radius of Levenberg-Marquardt
constexpr double kFastestGrowth = 10;  // the largest factor of the radius in one step
constexpr double kLeastDamping = 1e-16, kMostDamping = 1;

class LevenbergMarquardt : public Strategy {
 public:
  using Strategy::Strategy;

  double Step(const NormalEquations& equations, bool is_new, VectorXd* step) override {
    if (is_new) curvature_ = Curvature(equations);
    const VectorXd damping = curvature_ / radius_;
    return Solve(equations, damping, step) ? DecreaseOf(equations, damping, *step) : 0;
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
  bool IsLimited() const override { return radius_ < 1; }

 private:
  VectorXd curvature_;
  double shrinkage_ = 2;
};

// Powell's dog-leg.  If the whole Gauss-Newton step fails, shorter steps need no new factorization.
class Dogleg : public Strategy {
 public:
  using Strategy::Strategy;

  double Step(const NormalEquations& equations, bool is_new, VectorXd* step) override {
    if (is_new || stale_) {
      scale_ = Curvature(equations).cwiseSqrt();
      gradient_ = equations.gradient.cwiseQuotient(scale_);
      const VectorXd uphill = gradient_.cwiseQuotient(scale_);
      cauchy_ = gradient_.squaredNorm() / uphill.dot(equations.H.Multiply(uphill));
      if (!FindGaussNewton(equations)) return 0;
      stale_ = false;
    }
    *step = Within().cwiseQuotient(scale_);
    if (!IsLimited()) return DecreaseOf(equations, damping_ * scale_.cwiseAbs2(), *step);
    return -step->dot(equations.gradient + 0.5 * equations.H.Multiply(*step));
  }
  void Accept(double gain_ratio) override {
    if (gain_ratio < kPoorGain) radius_ *= 0.5;
    if (gain_ratio > kGoodGain) radius_ = std::max(radius_, 3 * step_norm_);
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

}  // namespace

VectorXd Strategy::Curvature(const NormalEquations& equations) {
  const VectorXd diagonal = equations.H.diagonal();
  if (first_scale_.size() == 0) first_scale_ = (1 + diagonal.array().sqrt()).inverse().square();
  return (diagonal.array() * first_scale_.array())
      .max(kSmallestScale)
      .min(kLargestScale)
      .matrix()
      .cwiseQuotient(first_scale_);
}

bool Strategy::Solve(const NormalEquations& equations, const VectorXd& damping, VectorXd* step) {
  if (!cholesky_.Factorize(equations.H, damping)) return false;
  *step = cholesky_.Solve(-equations.gradient);
  return step->allFinite();
}

bool Strategy::StepWithoutLimit(const NormalEquations& equations, VectorXd* step) {
  return Solve(equations, kLeastDamping * Curvature(equations), step);
}

std::unique_ptr<Strategy> MakeStrategy(Minimizer minimizer,
                                       std::shared_ptr<const Elimination> elimination,
                                       int threads) {
  if (minimizer == Minimizer::kDogleg) {
    return std::make_unique<Dogleg>(std::move(elimination), kLargestRadius, threads);
  }
  return std::make_unique<LevenbergMarquardt>(std::move(elimination), kDampedRadius, threads);
}

}  // namespace dqslam
