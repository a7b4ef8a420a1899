// What was estimated elsewhere, taken over by a history that has gone on meanwhile.
#pragma once

#include "dqslam/online/history.h"
#include "dqslam/problem/graph.h"

namespace dqslam::online {

/// Of the first poses and objects, log-Cholesky; later ones move rigidly with the last of these
/// poses.  Throws std::invalid_argument, and then nothing has changed.
template <typename Pose>
void Merge(const RowMatrix& poses, const RowMatrix& ellipsoids, History<Pose>* history);

}  // namespace dqslam::online
