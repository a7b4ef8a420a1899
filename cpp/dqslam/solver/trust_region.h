// Levenberg-Marquardt and Powell's dog-leg on normal equations, as Ceres' manual describes them.
// Levenberg-Marquardt starts damped, for stages far from their minimum; dog-leg starts with the
// whole Gauss-Newton step, for stages near it, and follows the bent valleys of objects whose tilt
// the boxes hardly determine.
#pragma once

#include "dqslam/solver/least_squares.h"

namespace dqslam {

struct TrustRegionOptions {
  Minimizer minimizer = Minimizer::kLevenbergMarquardt;
  int max_iterations = 100;
  double function_tolerance = 1e-10;
};

/// Minimizes from `values` on and writes the result there.  Throws Interrupted.
Summary Minimize(const TrustRegionOptions& options,
                 const Monitor& monitor,
                 LeastSquares* problem,
                 Eigen::VectorXd* values);

}  // namespace dqslam
