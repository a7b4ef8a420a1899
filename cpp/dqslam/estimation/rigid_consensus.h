// The rigid motion between two views of the same objects, some of which may be wrong.
#pragma once

#include <optional>
#include <vector>

#include "dqslam/estimation/initialize.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// An object in two places: where some new poses see it, and where the map has it.
struct PlacePair {
  Eigen::Vector3d seen, known;  ///< meters
  double tolerance;             ///< the largest distance of places that agree [m]
};

/// Places an object of known size by some views of it.
PlacePair PlaceOf(const Camera& camera,
                  const std::vector<View>& views,
                  const Surface<double>& known);

/// The motion, in the form of a pose, that takes most of the seen places to the known ones: the fit
/// to the pairs that agree with it, of all minimal sets of 2 pairs (3 in SE(3)) that with the
/// smallest truncated errors.  Returns nothing if no minimal set agrees with itself.  `agreed` are
/// the rows of the pairs that do.  The time is that of the third (fourth) power of their number.
template <typename Pose>
std::optional<Eigen::Matrix<double, Pose::kSize, 1>> FindRigidMotion(
    const std::vector<PlacePair>& pairs, std::vector<size_t>* agreed);

}  // namespace dqslam
