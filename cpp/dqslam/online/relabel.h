// Changes of the objects that boxes show.  An association may decide late which object a box shows,
// join two objects, or give one up.
#pragma once

#include <vector>

#include "dqslam/online/history.h"
#include "dqslam/online/observations.h"

namespace dqslam::online {

/// An object whose observations have changed.
struct Relabeled {
  int object;
  /// The poses before and after the longest new absence of the object.  Both are equal if there is
  /// none.
  int last, back;
};

/// Moves boxes from object to object and adds the new objects.  The other objects do not move.  The
/// work is linear in the boxes and in the observations of their objects.  Throws
/// std::invalid_argument naming the table and the row, and then nothing has changed.
template <typename Pose>
std::vector<Relabeled> Relabel(const NewLabels& given, History<Pose>* history);

}  // namespace dqslam::online
