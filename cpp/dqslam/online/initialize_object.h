// Where an object starts, and how it settles while the poses are held fixed.
#pragma once

#include "dqslam/online/linearize.h"

namespace dqslam::online {

/// Its cost and place after a few Levenberg-Marquardt steps over all its observations.
template <typename Pose>
double RefineObject(const Model& model,
                    const History<Pose>& history,
                    const Object& object,
                    int iterations,
                    Vector9d* center_shape);

/// From the first observation: at the depth that the prior size implies, or where it was measured.
template <typename Pose>
Vector9d InitializeObject(const Model& model, const History<Pose>& history, const Object& object);

/// From all its boxes: the sphere that fits their tangents, or of the prior size.
template <typename Pose>
Vector9d Reinitialize(const Model& model,
                      const History<Pose>& history,
                      const Object& object,
                      bool by_size);

/// Starts an object again from all its boxes, and keeps what fits them better.
template <typename Pose>
void ReinitializeIfBetter(const Model& model, const History<Pose>& history, Object* object);

/// Information about an object where it is, the poses of its observations held fixed.
template <typename Pose>
Matrix9d InformationAt(const Model& model, const History<Pose>& history, const Object& object);

}  // namespace dqslam::online
