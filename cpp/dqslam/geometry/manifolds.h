// Ceres manifolds, which define how a step moves a pose and an ellipsoid.
//
//   pose       Plus and Minus of pose.h, with the tangent in the frame of the pose.
//   ellipsoid  The tangent is that of its nine parameters, but the shape moves in a straight line,
//              S + dS, instead of the factor.  If the factor moved straight, a tilt l20 that the
//              boxes hardly determine would enter S_zz, and with it the height of all boxes, as
//              l20^2.  The resulting valley bends within millimeters and stops every minimizer.
#pragma once

#include <ceres/autodiff_manifold.h>

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"

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

class EllipsoidManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return kLandmarkSize; }
  int TangentSize() const override { return kLandmarkSize; }
  bool Plus(const double* ellipsoid, const double* tangent, double* result) const override;
  bool PlusJacobian(const double* ellipsoid, double* jacobian) const override;
  bool Minus(const double* ellipsoid, const double* origin, double* tangent) const override;
  bool MinusJacobian(const double* ellipsoid, double* jacobian) const override;
};

}  // namespace dqslam
