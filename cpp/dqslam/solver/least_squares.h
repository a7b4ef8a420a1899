// One stage of estimation as a least-squares problem with packed values, steps in the tangents and
// normal equations.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "dqslam/linear/elimination.h"
#include "dqslam/linear/normal_equations.h"
#include "dqslam/solver/stage.h"

namespace dqslam {

class LeastSquares {
 public:
  virtual ~LeastSquares() = default;

  /// Copies the parameters of the stage from a state, and back into it.
  virtual Eigen::VectorXd Pack(const State& state) const = 0;
  virtual void Unpack(const Eigen::VectorXd& values, State* state) const = 0;

  /// Moves the values by a step in the tangents of the variables.  Returns false where that is
  /// impossible.
  virtual bool Retract(const Eigen::VectorXd& values,
                       const Eigen::VectorXd& step,
                       Eigen::VectorXd* moved) const = 0;
  /// Moves along the path (path_step.h), which is the same to first order.  Returns false where
  /// that is impossible.
  virtual bool RetractAlongPath(const Eigen::VectorXd& values,
                                const Eigen::VectorXd& step,
                                Eigen::VectorXd* moved) const = 0;
  /// Computes the cost.  Returns false where a residual is undefined.
  virtual bool Cost(const Eigen::VectorXd& values, double* cost) const = 0;
  /// Computes equations().  Returns false where a residual is undefined.
  virtual bool Linearize(const Eigen::VectorXd& values) = 0;
  const NormalEquations& equations() const { return equations_; }
  /// Lays out the factorization of equations().H.
  virtual std::shared_ptr<const Elimination> LayOut() const {
    return std::make_shared<Elimination>(*equations_.H.pattern());
  }

 protected:
  explicit LeastSquares(BlockMatrix H) : equations_{0, Eigen::VectorXd(), std::move(H)} {}

  NormalEquations equations_;
};

/// Makes the problem of a stage.  A box whose box residual is undefined at `state` gets the tangent
/// residual instead.  `prepared` must outlive the result.
std::unique_ptr<LeastSquares> MakeLeastSquares(const SolveContext& context,
                                               const Stage& stage,
                                               const State& state);

}  // namespace dqslam
