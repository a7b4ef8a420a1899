// One stage of estimation as a least-squares problem: packed values, tangent steps, normal
// equations.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "dqslam/linear/normal_equations.h"
#include "dqslam/solver/stage.h"

namespace dqslam {

class LeastSquares {
 public:
  virtual ~LeastSquares() = default;

  /// The parameters that take part, of a state and back into it.
  virtual Eigen::VectorXd Pack(const State& state) const = 0;
  virtual void Unpack(const Eigen::VectorXd& values, State* state) const = 0;

  /// Moved by a step in the tangents of the variables; false where that is impossible.
  virtual bool Retract(const Eigen::VectorXd& values,
                       const Eigen::VectorXd& step,
                       Eigen::VectorXd* moved) const = 0;
  /// The same to first order, but along the path (path_step.h); false where that is impossible.
  virtual bool RetractAlongPath(const Eigen::VectorXd& values,
                                const Eigen::VectorXd& step,
                                Eigen::VectorXd* moved) const = 0;
  /// Returns false where a residual is undefined.
  virtual bool Cost(const Eigen::VectorXd& values, double* cost) const = 0;
  /// Likewise; sets equations().
  virtual bool Linearize(const Eigen::VectorXd& values) = 0;
  const NormalEquations& equations() const { return equations_; }

 protected:
  explicit LeastSquares(BlockMatrix H) : equations_{0, Eigen::VectorXd(), std::move(H)} {}

  NormalEquations equations_;
};

/// Where the box residual is undefined at `state`, that box gets the tangent residual.  `prepared`
/// must outlive the result.
std::unique_ptr<LeastSquares> MakeLeastSquares(const PreparedGraph& prepared,
                                               const SolveOptions& options,
                                               const Stage& stage,
                                               const State& state);

}  // namespace dqslam
