// What an object's sights say from poses that are constant: a Gaussian on the object.
#pragma once

#include "dqslam/online/linearize.h"

namespace dqslam::online {

/// How many sights of an object are from poses before `pose`; it has `known` at least.
template <typename Pose>
int CountPast(const History<Pose>& history, const Object& object, int pose, int known);

/// Adds rows [first, last) of object.sights, linearised where all stand now.
template <typename Pose>
void AddPast(const Model& model,
             const History<Pose>& history,
             const Object& object,
             int first,
             int last,
             Quadratic* past);

/// Brings up to date what the objects seen from `begin` on keep of their sights before it: new ones
/// are added, and all are linearised anew where the object is stale or they have grown by a
/// quarter.  Returns how many sights were linearised.
template <typename Pose>
int KeepPast(const Model& model, int begin, History<Pose>* history);

/// The objects seen from `begin` on have moved, and so have these poses.
template <typename Pose>
void MarkStale(int begin, History<Pose>* history);

}  // namespace dqslam::online
