// Ceres manifolds of the pose models: Plus and Minus of pose.h, tangent in the frame of the pose.
#pragma once

#include <ceres/autodiff_manifold.h>

#include "dqslam/pose.h"

namespace dqslam {

template <typename Pose>
struct PoseManifoldFunctor {
  template <typename T>
  bool Plus(const T* pose, const T* tangent, T* result) const {
    dqslam::Plus<Pose>(pose, tangent, result);
    return true;
  }

  template <typename T>
  bool Minus(const T* pose, const T* origin, T* tangent) const {
    dqslam::Minus<Pose>(pose, origin, tangent);
    return true;
  }
};

template <typename Pose>
using PoseManifold =
    ceres::AutoDiffManifold<PoseManifoldFunctor<Pose>, Pose::kSize, Pose::kTangentSize>;

}  // namespace dqslam
