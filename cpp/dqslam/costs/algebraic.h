// The paper's box residual:  r_k = l_k^T P Q* P^T l_k / sigma for the four lines of the box,
// l_k = x_a cross x_b of neighboring corners in homogeneous pixels.   [S&M17] eqs. (5), (7)
// The normalized residual is divided by (P Q* P^T)_33 = p_z^2 - S_zz; the paper does not divide.
//
// Blocks: world_from_robot [d], landmark [9].  Residual: [4], in sigmas.
// The residual as published never fails.  The normalized one returns false where (P Q* P^T)_33 is
// not positive, that is, where the camera's focal plane meets the object.
#pragma once

#include <array>

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

/// K^T l for the left, top, right and bottom line of a box.  These are the normals, in the camera
/// frame, of the planes through the camera and the lines.
inline std::array<Eigen::Vector3d, 4> BoxLines(const Camera& camera, const Eigen::Vector4d& box) {
  Eigen::Matrix3d K;
  K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  const Eigen::Vector3d top_left(box[0], box[1], 1), top_right(box[2], box[1], 1),
      bottom_right(box[2], box[3], 1), bottom_left(box[0], box[3], 1);
  return {K.transpose() * bottom_left.cross(top_left),
          K.transpose() * top_left.cross(top_right),
          K.transpose() * top_right.cross(bottom_right),
          K.transpose() * bottom_right.cross(bottom_left)};
}

template <typename Pose, typename Landmark>
struct AlgebraicCost
    : AutoDiffCost<AlgebraicCost<Pose, Landmark>, kBoxSize, Pose::kSize, kLandmarkSize> {
  Mount mount;
  std::array<Eigen::Vector3d, 4> normals;  ///< BoxLines()
  Eigen::Matrix4d sqrt_information;
  bool normalized;

  template <typename T>
  bool operator()(const T* pose, const T* landmark, T* residual) const {
    const Surface<T> surface =
        ToCamera(LocateCamera<Pose>(pose, mount), Landmark::Unpack(landmark));
    const Vector3<T>& p = surface.center;
    T scale(1);
    if (normalized) {
      const T c33 = p.z() * p.z() - surface.shape(2, 2);
      if (!(c33 > T(0))) return false;
      scale = T(1) / c33;
    }
    Vector4<T> error;
    for (int k = 0; k < 4; ++k) {
      const Vector3<T> n = normals[k].cast<T>();
      const T distance = n.dot(p);
      error[k] = scale * (distance * distance - n.dot(surface.shape * n));
    }
    Whiten(sqrt_information, error, residual);
    return true;
  }
};

}  // namespace dqslam
