// Boxes that change objects: an association may decide late which boxes show which object, join two
// objects, or give one up.
#pragma once

#include <vector>

#include "dqslam/online/history.h"
#include "dqslam/online/observations.h"

namespace dqslam::online {

/// An object whose observations have changed.
struct Relabeled {
  int object;
  /// Poses before and after the longest absence that it has only now; the same where it has none.
  int last, back;
};

/// Moves boxes from object to object, adds the new objects, and leaves the others where they are.
/// The work is that of the boxes and of the observations of their objects.  Throws
/// std::invalid_argument naming the table and the row, and then nothing has changed.
template <typename Pose>
std::vector<Relabeled> Relabel(const NewLabels& given, History<Pose>* history);

}  // namespace dqslam::online
