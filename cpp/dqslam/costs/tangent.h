// Signed distance of the ellipsoid to the plane behind each edge of the box:
//   r_k = (n_k . p + |L^T n_k|) focal / depth,   n = (1, 0, -x) for the right edge, and so on.
// The algebraic residual of [S&M17] eq. (5) is (n.p + h)(n.p - h) with h = |L^T n|.  The residual
// here is its first factor, which vanishes where the plane touches the object from *outside the
// box*.  The second factor vanishes where the plane touches the object's far side.
//
// Blocks: world_from_robot [d], landmark [9].  Residual: [4], in sigmas.
// The scale focal / depth turns meters into pixels; `depth` is frozen while a stage runs.
// An edge flagged one_sided counts only where the object ends inside the box.
// The residual is affine in the center and is defined for every ellipsoid, also for one that is
// behind or beside the camera, or around it.
// Returns false where n^T S n is not positive, which happens only for a dual quadric that is not an
// ellipsoid.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

template <typename Pose, typename Landmark>
struct TangentCost
    : AutoDiffCost<TangentCost<Pose, Landmark>, kBoxSize, Pose::kSize, kLandmarkSize> {
  Camera camera;
  Mount mount;
  Eigen::Vector4d observed;          ///< pixels
  Eigen::Matrix4d sqrt_information;  ///< 1 / pixels
  double depth;                      ///< meters
  EdgeFlags one_sided = EdgeFlags::Constant(false);
  Landmark model = {};

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    const auto surface = ToCamera(LocateCamera<Pose>(pose, mount), model.Unpack(landmark));
    Vector4<T> error;
    if (!TangentDistances(surface, camera, observed, depth, &error)) return false;
    IgnoreBeyond(one_sided, &error, kTangentOutward);
    Whiten(sqrt_information, error, residual);
    return true;
  }
};

}  // namespace dqslam
