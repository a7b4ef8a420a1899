// Levenberg-Marquardt and Powell's dog-leg on normal equations, as Ceres' manual describes them.
// Levenberg-Marquardt starts with damping and is used for stages far from their minimum.  Dog-leg
// starts with the whole Gauss-Newton step and is used for stages near it; it also follows the
// curved valleys of the cost that belong to objects whose tilt the boxes hardly determine.
#pragma once

#include "dqslam/solver/least_squares.h"

namespace dqslam {

struct TrustRegionOptions {
  Minimizer minimizer = Minimizer::kLevenbergMarquardt;
  int max_iterations = 100;
  double function_tolerance = 1e-10;
  int threads = 1;  ///< of the factorization
};

/// Minimizes from `values` and writes the result there.  Throws Interrupted.
Summary Minimize(const TrustRegionOptions& options,
                 const Monitor& monitor,
                 LeastSquares* problem,
                 Eigen::VectorXd* values);

}  // namespace dqslam
