// Knowledge of a scene beyond its boxes: objects stand upright, objects stand on a plane, and the
// camera has a known height above that plane {x : n.x + d = 0}, where the unit normal n points up.
//
//   UprightCost        r = cross(n, S n) / (n^T S n sigma).  It is zero when n is a principal axis
//                      of the object.  For a small tilt [rad] it is about the tilt times (1 - ratio
//                      of squared semi-axes).  Two of its three entries are independent.
//   SupportPlaneCost   r = (n.c + d - |L^T n|) / sigma.  It is zero when the object's lowest point
//                      lies on the plane.
//   CameraHeightCost   r = (n.camera + d - height) / sigma.
//
// Blocks: ellipsoid [9]; ellipsoid [9]; world_from_robot [d].  Residuals: [3], [1], [1], in sigmas.
// None of them fails.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

struct UprightCost : AutoDiffCost<UprightCost, 3, kLandmarkSize> {
  Eigen::Vector3d up;
  double sigma;  ///< radians of tilt

  template <typename T>
  bool operator()(const T* ellipsoid, T* residual) const {
    const Vector3<T> n = up.cast<T>();
    const Vector3<T> image = EllipsoidModel::Unpack(ellipsoid).shape * n;
    Eigen::Map<Vector3<T>> r(residual);
    r = n.cross(image) / (n.dot(image) * T(sigma));
    return true;
  }
};

struct SupportPlaneCost : AutoDiffCost<SupportPlaneCost, 1, kLandmarkSize> {
  Eigen::Vector3d up;
  double offset;  ///< d, meters
  double sigma;   ///< meters

  template <typename T>
  bool operator()(const T* ellipsoid, T* residual) const {
    using std::sqrt;
    const Surface<T> surface = EllipsoidModel::Unpack(ellipsoid);
    const Vector3<T> n = up.cast<T>();
    const T half_height = sqrt(n.dot(surface.shape * n));
    residual[0] = (n.dot(surface.center) + T(offset) - half_height) / T(sigma);
    return true;
  }
};

template <typename Pose>
struct CameraHeightCost : AutoDiffCost<CameraHeightCost<Pose>, 1, Pose::kSize> {
  Mount mount;
  Eigen::Vector3d up;
  double offset;  ///< d, meters
  double height;  ///< meters
  double sigma;   ///< meters

  template <typename T>
  bool operator()(const T* pose, T* residual) const {
    const CameraInWorld<T> camera = LocateCamera<Pose>(pose, mount);
    residual[0] = (up.cast<T>().dot(camera.position) + T(offset - height)) / T(sigma);
    return true;
  }
};

}  // namespace dqslam
