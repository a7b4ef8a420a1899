// Recent poses and the objects they saw first, started again where a window cannot leave a place.
#pragma once

#include "dqslam/online/options.h"
#include "dqslam/online/window.h"

namespace dqslam::online {

/// Boxes reject most places far from the right one.  Poses from `begin` on go back to their
/// odometry and their young objects to their starts: the tangent residual leads from there to what
/// the boxes then refine, as in Grow().  Keeps what costs least; returns how many observations were
/// linearized.
template <typename Pose>
int Recover(const Model& model,
            int begin,
            const OnlineOptions& options,
            Window<Pose>* window,
            History<Pose>* history);

}  // namespace dqslam::online
