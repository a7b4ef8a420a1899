// Derivatives of the errors of a box's edges by the pose and the landmark, by hand.  They are six
// times faster than AutoDiff of costs/box.h and costs/tangent.h, which define these errors.
//
// Let p, S be the surface in the camera and n the normal of the plane through an edge.  Then the
// differential of both errors is
//   d error = by_center n.dp + by_shape n^T dS n
// The edge x of the exact box solves F = n^T S n - (n.p)^2 = 0 for n = e - x e_z.  Hence
// dx = -dF / (2 (x D - B)) with B, D of ProjectToBox.
#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

/// Derivatives of the errors of four edges, with a column of `normal` and an entry for each.
struct EdgeDerivatives {
  Eigen::Matrix<double, 3, kBoxSize> normal;  ///< n, in the frame of the camera
  Eigen::Vector4d by_center, by_shape;
};

/// Does what ProjectToBox does, with derivatives.
inline bool DifferentiateBox(const Surface<double>& in_camera,
                             const Camera& camera,
                             Eigen::Vector4d* box,
                             EdgeDerivatives* edges) {
  if (!ProjectToBox(in_camera, camera, box)) return false;
  const Eigen::Vector3d& p = in_camera.center;
  const Matrix3<double>& S = in_camera.shape;
  const double D = S(2, 2) - p.z() * p.z();
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  edges->normal.setZero();
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    const double x = ((*box)[edge] - principal[axis]) / focal[axis];
    const double slope = x * D - (S(axis, 2) - p[axis] * p.z());
    edges->normal(axis, edge) = 1;
    edges->normal(2, edge) = -x;
    edges->by_center[edge] = focal[axis] * (p[axis] - x * p.z()) / slope;
    edges->by_shape[edge] = -0.5 * focal[axis] / slope;
  }
  return true;
}

/// Does what TangentDistances does, with derivatives.
inline bool DifferentiateTangents(const Surface<double>& in_camera,
                                  const Camera& camera,
                                  const Eigen::Vector4d& box,
                                  double depth,
                                  Eigen::Vector4d* distances,
                                  EdgeDerivatives* edges) {
  const Eigen::Vector3d& p = in_camera.center;
  const Matrix3<double>& S = in_camera.shape;
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  edges->normal.setZero();
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    const double outward = edge < 2 ? -1 : 1;
    const double scale = focal[axis] / depth;
    const double x = (box[edge] - principal[axis]) / focal[axis];
    const double squared = S(axis, axis) - 2 * x * S(axis, 2) + x * x * S(2, 2);
    if (!(squared > 0)) return false;
    const double half_width = std::sqrt(squared);
    (*distances)[edge] = scale * (outward * (p[axis] - x * p.z()) + half_width);
    edges->normal(axis, edge) = 1;
    edges->normal(2, edge) = -x;
    edges->by_center[edge] = scale * outward;
    edges->by_shape[edge] = 0.5 * scale / half_width;
  }
  return true;
}

/// Does what IgnoreBeyond of ellipsoid.h does, with derivatives.
inline void IgnoreBeyond(const EdgeFlags& one_sided,
                         const double (&outward)[kBoxSize],
                         Eigen::Vector4d* error,
                         EdgeDerivatives* edges) {
  for (int edge = 0; edge < kBoxSize; ++edge) {
    if (!IsBeyond(one_sided[edge], outward[edge], (*error)[edge])) continue;
    (*error)[edge] = edges->by_center[edge] = edges->by_shape[edge] = 0;
  }
}

/// Error of each edge of an observed box.  It is that of the exact box if `depth` is 0, and else
/// that of the tangents at this depth.  There are derivatives with kDerivatives.  Returns false if
/// an error is undefined.
template <bool kDerivatives, typename Object, typename Derivatives>
bool EdgeErrors(const Object& in_camera,
                const Camera& camera,
                const Eigen::Vector4d& observed,
                double depth,
                const EdgeFlags& one_sided,
                Eigen::Vector4d* error,
                Derivatives* edges) {
  const bool is_box = depth == 0;
  bool defined = false;
  if constexpr (kDerivatives) {
    defined = is_box ? DifferentiateBox(in_camera, camera, error, edges)
                     : DifferentiateTangents(in_camera, camera, observed, depth, error, edges);
  } else {
    defined = is_box ? ProjectToBox(in_camera, camera, error)
                     : TangentDistances(in_camera, camera, observed, depth, error);
  }
  if (!defined) return false;
  if (is_box) *error -= observed;
  const auto& outward = is_box ? kBoxOutward : kTangentOutward;
  if constexpr (kDerivatives) {
    IgnoreBeyond(one_sided, outward, error, edges);
  } else {
    IgnoreBeyond(one_sided, error, outward);
  }
  return true;
}

/// A pose of the robot and of its camera, in the form that derivatives need.
struct Station {
  template <typename Pose>
  static Station At(const double* pose, const Mount& mount) {
    return {pose, Pose::template WorldFromRobot<double>(pose), LocateCamera<Pose>(pose, mount)};
  }
  const double* pose;  ///< parameters, which must outlive the station
  Rigid<double> world_from_robot;
  CameraInWorld<double> camera;
};

/// A landmark in the world, with the derivative of m^T S m by its parameters.
template <typename Landmark>
struct Unpacked;

template <>
struct Unpacked<EllipsoidModel> {
  explicit Unpacked(const double* e) : surface(EllipsoidModel::Unpack(e)) {
    factor << std::exp(e[3]), 0, 0, e[6], std::exp(e[4]), 0, e[7], e[8], std::exp(e[5]);
  }
  /// Derivative of by_center m.c + by_shape m^T S m by the nine parameters.
  Vector9d Gradient(const Eigen::Vector3d& m, double by_center, double by_shape) const {
    const Eigen::Vector3d g = 2 * by_shape * (factor.transpose() * m);
    Vector9d gradient;
    gradient << by_center * m, g[0] * m[0] * factor(0, 0), g[1] * m[1] * factor(1, 1),
        g[2] * m[2] * factor(2, 2), g[0] * m[1], g[0] * m[2], g[1] * m[2];
    return gradient;
  }
  Surface<double> surface;
  Matrix3<double> factor;  ///< L
};

/// Converts the derivatives of edges to derivatives by the tangent of the pose and by the landmark.
template <typename Pose, typename Landmark>
void ByPoseAndLandmark(const EdgeDerivatives& edges,
                       const Station& station,
                       const Mount& mount,
                       const Unpacked<Landmark>& landmark,
                       Eigen::Matrix<double, kBoxSize, Pose::kTangentSize>* by_pose,
                       Eigen::Matrix<double, kBoxSize, kLandmarkSize>* by_landmark) {
  const Matrix3<double>& R = station.world_from_robot.rotation;
  const Eigen::Vector3d in_robot =
      R.transpose() * (landmark.surface.center - station.world_from_robot.translation);
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const double a = edges.by_center[edge], b = edges.by_shape[edge];
    const Eigen::Vector3d k = mount.camera_from_robot.transpose() * edges.normal.col(edge);
    const Eigen::Vector3d m = R * k;
    const Eigen::Vector3d pulled = R.transpose() * (landmark.surface.shape * m);
    const Eigen::Vector3d turn = k.cross(a * in_robot + 2 * b * pulled);
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      by_pose->row(edge) << -a * k.x(), -a * k.y(), turn.z();
    } else {
      by_pose->row(edge) << -a * k.transpose(), turn.transpose();
    }
    by_landmark->row(edge) = landmark.Gradient(m, a, b).transpose();
  }
}

}  // namespace dqslam
