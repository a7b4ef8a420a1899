// Converts enums to template arguments.
#pragma once

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// Calls visit(Pose{}, Landmark{}) with the types that the two enums name.
template <typename Visit>
auto Dispatch(PoseModel pose_model, LandmarkModel landmark_model, Visit&& visit) {
  const bool planar = pose_model == PoseModel::kSe2;
  if (landmark_model == LandmarkModel::kEllipsoid) {
    return planar ? visit(Se2{}, EllipsoidModel{}) : visit(Se3{}, EllipsoidModel{});
  }
  return planar ? visit(Se2{}, DualQuadricModel{}) : visit(Se3{}, DualQuadricModel{});
}

/// Calls visit(Pose{}) with the type that the enum names.
template <typename Visit>
auto Dispatch(PoseModel pose_model, Visit&& visit) {
  return pose_model == PoseModel::kSe2 ? visit(Se2{}) : visit(Se3{});
}

}  // namespace dqslam
