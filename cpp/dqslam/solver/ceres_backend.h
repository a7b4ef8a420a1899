// Minimization of a stage by ceres::Solve.
#pragma once

#include "dqslam/solver/trust_region.h"

namespace ceres {
class Problem;
}

namespace dqslam {

/// Minimizes from the present parameters of the problem.  Throws Interrupted.
Summary MinimizeByCeres(const TrustRegionOptions& options,
                        const Monitor& monitor,
                        ceres::Problem* problem);

}  // namespace dqslam
