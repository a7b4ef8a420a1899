// How a step moves the variables of a stage: each by itself, or along the path (path_step.h).
#pragma once

#include "dqslam/solver/packed_stage.h"

namespace dqslam {

/// False where that is impossible.
template <typename Pose, typename Landmark>
bool Retract(const PackedStage<Pose>& stage,
             const Eigen::VectorXd& values,
             const Eigen::VectorXd& step,
             Eigen::VectorXd* moved);

/// False where that is impossible, and for dual quadrics, which have no shape to turn.
template <typename Pose, typename Landmark>
bool RetractAlongPath(const PackedStage<Pose>& stage,
                      const Eigen::VectorXd& values,
                      const Eigen::VectorXd& step,
                      Eigen::VectorXd* moved);

}  // namespace dqslam
