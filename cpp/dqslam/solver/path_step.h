// A step, taken along the path instead of straight.
//
// Plus moves each pose and each object by itself. Where a long path turns as a whole, by theta,
// each goes along its tangent, and the path gets longer by theta^2 / 2 of itself: odometry does not
// forgive that, and the step must be cut again and again. Here the same step is read as a change of
// each pose relative to the one before it, and of each object relative to a pose that sees it; then
// the path is put together anew. Both are the same to first order, and a turn of everything is
// exact. (Olson, Leonard & Teller 2006 parametrize poses this way; here the equations stay those of
// Plus, and sparse.)
#pragma once

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// A pose before and after a step, with the tangent that led there to first order.
struct MovedPose {
  const double* before;
  const double* tangent;
  const double* after;
};

/// Moves a pose by its tangent relative to the moved pose before it.
template <typename Pose>
void PlusBehind(const MovedPose& previous,
                const double* pose,
                const double* tangent,
                double* moved);

/// Moves an ellipsoid by its tangent (EllipsoidManifold) relative to a moved pose; false where
/// that is impossible.
template <typename Pose>
bool PlusBeside(const MovedPose& viewer,
                const double* ellipsoid,
                const double* tangent,
                double* moved);

}  // namespace dqslam
