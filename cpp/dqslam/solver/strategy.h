// The length and direction of steps, by Levenberg-Marquardt or by Powell's dog-leg.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "dqslam/linear/block_cholesky.h"
#include "dqslam/linear/normal_equations.h"
#include "dqslam/problem/options.h"

namespace dqslam {

/// Limits of the gain ratio, which is the decrease of the cost divided by the decrease that the
/// quadratic model predicts.  The model is poor below the first limit and good above the second.
constexpr double kPoorGain = 0.25, kGoodGain = 0.75;

/// The state of a trust region, with the factorization behind its steps.
class Strategy {
 public:
  Strategy(std::shared_ptr<const Elimination> elimination, double radius, int threads)
      : radius_(radius), cholesky_(std::move(elimination), threads) {}
  virtual ~Strategy() = default;
  /// Computes the step.  `is_new` is false if the equations are those of the last call.  Returns
  /// the decrease of the cost that the model predicts, which is 0 where there is no step.
  virtual double Step(const NormalEquations& equations, bool is_new, Eigen::VectorXd* step) = 0;
  /// Computes the step that the model would take without a trust region.  Returns false where there
  /// is no such step.
  bool StepWithoutLimit(const NormalEquations& equations, Eigen::VectorXd* step);
  virtual void Accept(double gain_ratio) = 0;
  virtual void Reject() = 0;
  virtual void RejectInvalid() = 0;
  /// Whether the trust region shortened the step.  If so, a small change of cost does not mean
  /// convergence.
  virtual bool IsLimited() const { return false; }
  double radius() const { return radius_; }

 protected:
  /// Squared scale of each variable: the diagonal of H, within limits.
  Eigen::VectorXd Curvature(const NormalEquations& equations);
  /// Computes the step with a damping for each variable.  Returns false where there is no step.
  bool Solve(const NormalEquations& equations,
             const Eigen::VectorXd& damping,
             Eigen::VectorXd* step);

  double radius_;

 private:
  BlockCholesky cholesky_;
  Eigen::VectorXd first_scale_;
};

/// Makes a strategy for matrices with the pattern that was laid out.
std::unique_ptr<Strategy> MakeStrategy(Minimizer minimizer,
                                       std::shared_ptr<const Elimination> elimination,
                                       int threads);

}  // namespace dqslam
