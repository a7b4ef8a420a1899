// A loop that does not fit: all poses since what has come back was seen last.
#pragma once

#include "dqslam/online/options.h"
#include "dqslam/online/window.h"

namespace dqslam::online {

/// Minimizes all poses from `begin` on.  Boxes say little of an object that is far beside them.
/// Where one does not fit then, the window's poses, which have been bent towards what came back, go
/// back to their odometry, the objects to where they were before, and what the boxes since then say
/// of them is at first a point each: positions lead from far to what the boxes then refine.  Keeps
/// what costs least.
template <typename Pose>
WindowResult CloseLoop(const Model& model,
                       int begin,
                       int window_begin,
                       const OnlineOptions& options,
                       Window<Pose>* window,
                       History<Pose>* history);

}  // namespace dqslam::online
