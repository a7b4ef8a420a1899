// How a step moves the variables of a stage: each by itself, or along the path (path_step.h).
#pragma once

#include "dqslam/solver/stage_terms.h"

namespace dqslam {

/// Moves each variable by itself.  Returns false where that is impossible.
template <typename Pose>
bool Retract(const StageTerms& terms,
             const Eigen::VectorXd& values,
             const Eigen::VectorXd& step,
             Eigen::VectorXd* moved);

/// Moves along the path, which is the same to first order.  Returns false where that is impossible.
template <typename Pose>
bool RetractAlongPath(const PreparedGraph& prepared,
                      const StageTerms& terms,
                      const Eigen::VectorXd& values,
                      const Eigen::VectorXd& step,
                      Eigen::VectorXd* moved);

}  // namespace dqslam
