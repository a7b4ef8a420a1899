// A step that is taken along the path instead of straight.
//
// Plus moves each pose and each object by itself. When a long path turns as a whole by theta, each
// pose moves along its tangent, and the path gets longer by the fraction theta^2 / 2. Odometry
// penalizes that so much that the step must be shortened again and again. Here the step is
// interpreted as a change of each pose relative to the pose before it, and of each object relative
// to a pose that observes it; then the path is composed again. Both steps are the same to first
// order, and here a rotation of everything is exact. (Olson, Leonard & Teller 2006 parametrize
// poses in this way; here the equations remain those of Plus, and sparse.)
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

/// Moves an ellipsoid by its tangent (EllipsoidManifold) relative to a moved pose.  Returns false
/// where that is impossible.
template <typename Pose>
bool PlusBeside(const MovedPose& viewer,
                const double* ellipsoid,
                const double* tangent,
                double* moved);

/// Adds a tangent to the parameters of a cuboid or a cylinder.  Returns false where a length
/// changes by more than a factor of e^3, for which no linearization holds.
bool PlusBody(const double* body, const double* tangent, double* moved);

/// Moves a cuboid or a cylinder by its tangent relative to a moved pose.
template <typename Pose>
bool PlusBodyBeside(const MovedPose& viewer,
                    const double* body,
                    const double* tangent,
                    double* moved);

}  // namespace dqslam
