// Detection against the projected ellipsoid:  r = W (box(C*) - observed),  C* = P Q* P^T.
// [S&M17] sec. 3.3, with the exact bounding box of the outline.
//
// Blocks: world_from_robot [d], landmark [9].  Residual: [4], in sigmas.
// Edges flagged one_sided count only where the prediction ends inside the observed edge.
// Returns false, so that Ceres rejects the step, unless the object is strictly in front.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

template <typename Pose, typename Landmark>
struct BoxCost : AutoDiffCost<BoxCost<Pose, Landmark>, kBoxSize, Pose::kSize, kLandmarkSize> {
  Camera camera;
  Mount mount;
  Eigen::Vector4d observed;          ///< pixels
  Eigen::Matrix4d sqrt_information;  ///< 1 / pixels
  EdgeFlags one_sided = EdgeFlags::Constant(false);

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    Vector4<T> predicted;
    const Surface<T> surface =
        ToCamera(LocateCamera<Pose>(pose, mount), Landmark::Unpack(landmark));
    if (!ProjectToBox(surface, camera, &predicted)) return false;
    Vector4<T> error = predicted - observed.cast<T>();
    IgnoreBeyond(one_sided, &error);
    Whiten(sqrt_information, error, residual);
    return true;
  }
};

}  // namespace dqslam
