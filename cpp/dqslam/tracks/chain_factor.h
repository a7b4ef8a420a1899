// The Cholesky factor of a track's normal equations: a chain of blocks, and its border.
#pragma once

#include <Eigen/Cholesky>
#include <optional>
#include <vector>

#include "dqslam/tracks/equations.h"

namespace dqslam::tracks {

class ChainFactor {
 public:
  /// None where the equations are not positive definite.  `damping` is a share of what boxes tell:
  /// what rests is bound so stiffly from image to image that a share of the whole diagonal would
  /// keep it where it is.
  static std::optional<ChainFactor> Make(const Equations& equations, double damping = 0);

  /// Solves for right sides of the states, then of the size, shape (6 n + 3, r).
  RowMatrix Solve(const RowMatrix& right) const;
  double LogDeterminant() const;

 private:
  bool Factorize(const Equations& equations, double damping);
  void SolveChain(Eigen::Ref<RowMatrix> right) const;

  std::vector<StateMatrix> own_;    // lower triangles on the diagonal
  std::vector<StateMatrix> below_;  // of each state and the one before it
  RowMatrix border_, reduced_;      // (6 n, 3); the border, and what the chain makes of it
  Eigen::LLT<Eigen::Matrix3d> corner_;
};

}  // namespace dqslam::tracks
