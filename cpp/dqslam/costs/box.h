// Difference between the box of the projected ellipsoid and the detected box:
//   r = W (box(C*) - observed),  C* = P Q* P^T.
// See [S&M17] sec. 3.3; here the bounding box of the outline is exact.
//
// Blocks: world_from_robot [d], landmark [9].  Residual: [4], in sigmas.
// An edge flagged one_sided counts only where the predicted edge is inside the observed one.
// The cost returns false, so that Ceres rejects the step, unless the object is strictly in front of
// the camera.
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
  Landmark model = {};

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    Vector4<T> predicted;
    const auto surface = ToCamera(LocateCamera<Pose>(pose, mount), model.Unpack(landmark));
    if (!ProjectToBox(surface, camera, &predicted)) return false;
    Vector4<T> error = predicted - observed.cast<T>();
    IgnoreBeyond(one_sided, &error);
    Whiten(sqrt_information, error, residual);
    return true;
  }
};

}  // namespace dqslam
