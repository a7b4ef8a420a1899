// How far a step goes, and where: Levenberg-Marquardt and Powell's dog-leg.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "dqslam/linear/block_cholesky.h"
#include "dqslam/linear/normal_equations.h"
#include "dqslam/problem/options.h"

namespace dqslam {

/// Gain ratios, of a decrease to the one that the model predicts: below the first, a step went
/// beyond what the model is good for; above the second, the model is good.
constexpr double kPoorGain = 0.25, kGoodGain = 0.75;

/// The state of a trust region, with the factorization behind its steps.
class Strategy {
 public:
  Strategy(const BlockMatrix& H, double radius) : radius_(radius), cholesky_(H) {}
  virtual ~Strategy() = default;
  /// The step for equations that have not changed since the last call unless is_new; false where
  /// there is none.
  virtual bool Step(const NormalEquations& equations, bool is_new, Eigen::VectorXd* step) = 0;
  virtual void Accept(double gain_ratio) = 0;
  virtual void Reject() = 0;
  virtual void RejectInvalid() = 0;
  /// Whether the trust region cut the step: then a small change of cost says nothing.
  virtual bool IsLimited() const { return false; }
  double radius() const { return radius_; }

 protected:
  /// Squared scale of each variable: the curvature, within limits that are relative to the first.
  Eigen::VectorXd Curvature(const NormalEquations& equations);
  /// The step that damps each variable by so much; false where there is none.
  bool Solve(const NormalEquations& equations,
             const Eigen::VectorXd& damping,
             Eigen::VectorXd* step);

  double radius_;

 private:
  BlockCholesky cholesky_;
  Eigen::VectorXd first_scale_;
};

/// `H` is only looked at for its pattern.
std::unique_ptr<Strategy> MakeStrategy(Minimizer minimizer, const BlockMatrix& H);

}  // namespace dqslam
