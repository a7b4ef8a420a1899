// What an object's observations say from poses that are constant: a Gaussian on the object.
#pragma once

#include "dqslam/online/linearize.h"

namespace dqslam::online {

/// How many observations of an object are from poses before `pose`; it has `known` at least.
template <typename Pose>
int CountMarginalized(const History<Pose>& history, const Object& object, int pose, int known);

/// Adds rows [first, last) of object.observations, linearized where all stand now.
template <typename Pose>
void AddToMarginalPrior(const Model& model,
                        const History<Pose>& history,
                        const Object& object,
                        int first,
                        int last,
                        GaussianPrior* marginal);

/// Brings up to date what the objects seen from `begin` on keep of their observations before it:
/// new ones are added, and all are linearized anew where the object is stale or they have grown by
/// a quarter.  Returns how many observations were linearized.
template <typename Pose>
int UpdateMarginalPriors(const Model& model, int begin, History<Pose>* history);

/// The objects seen from `begin` on have moved, and so have these poses.
template <typename Pose>
void MarkStale(int begin, History<Pose>* history);

}  // namespace dqslam::online
