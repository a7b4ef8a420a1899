// Derivatives of the errors of a box's edges by the pose and by a cuboid or a cylinder, by hand, as
// in geometry/box_derivatives.h.
//
// The plane with the normal n through an edge touches the body at c + A u.  As u is the farthest
// point along n, a change of u has no effect to first order:
//   d error = by_center n.dc + n^T dA by_factor,   by_factor = by_center u
#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "dqslam/geometry/body.h"
#include "dqslam/geometry/box_derivatives.h"

namespace dqslam {

/// Derivatives of the errors of four edges, with a column or an entry for each.
struct BodyEdgeDerivatives {
  Eigen::Matrix<double, 3, kBoxSize> normal;  ///< n, in the frame of the camera
  Eigen::Vector4d by_center;
  Eigen::Matrix<double, 3, kBoxSize> by_factor;
};

/// Does what ProjectToBox does, with derivatives.
inline bool DifferentiateBox(const Body<double>& in_camera,
                             const Camera& camera,
                             Eigen::Vector4d* box,
                             BodyEdgeDerivatives* edges) {
  if (!StrictlyInFront(in_camera)) return false;
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  edges->normal.setZero();
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    const double outward = edge < 2 ? -1 : 1;
    const TouchingLine line = FindTouchingLine(in_camera, axis, outward);
    (*box)[edge] = focal[axis] * line.slope + principal[axis];
    edges->normal(axis, edge) = 1;
    edges->normal(2, edge) = -line.slope;
    edges->by_center[edge] = focal[axis] / line.depth;
    edges->by_factor.col(edge) = outward * edges->by_center[edge] * line.u;
  }
  return true;
}

/// Does what TangentDistances does, with derivatives.
inline bool DifferentiateTangents(const Body<double>& in_camera,
                                  const Camera& camera,
                                  const Eigen::Vector4d& box,
                                  double depth,
                                  Eigen::Vector4d* distances,
                                  BodyEdgeDerivatives* edges) {
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  edges->normal.setZero();
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    edges->normal(axis, edge) = 1;
    edges->normal(2, edge) = -(box[edge] - principal[axis]) / focal[axis];
    Eigen::Vector3d u;
    Width(in_camera.shape,
          in_camera.rounding,
          Eigen::Vector3d(in_camera.factor.transpose() * edges->normal.col(edge)),
          &u);
    edges->by_center[edge] = (edge < 2 ? -1 : 1) * focal[axis] / depth;
    edges->by_factor.col(edge) = focal[axis] / depth * u;
  }
  return TangentDistances(in_camera, camera, box, depth, distances);
}

/// Does what IgnoreBeyond of ellipsoid.h does, with derivatives.
inline void IgnoreBeyond(const EdgeFlags& one_sided,
                         const double (&outward)[kBoxSize],
                         Eigen::Vector4d* error,
                         BodyEdgeDerivatives* edges) {
  for (int edge = 0; edge < kBoxSize; ++edge) {
    if (!IsBeyond(one_sided[edge], outward[edge], (*error)[edge])) continue;
    (*error)[edge] = edges->by_center[edge] = 0;
    edges->by_factor.col(edge).setZero();
  }
}

/// A cuboid or a cylinder in the world, with what its derivatives need.
template <>
struct Unpacked<BodyModel> {
  Unpacked() = default;
  Unpacked(const BodyModel& model, const double* parameters);
  Body<double> surface;
  Eigen::Matrix3d rotation;   ///< world_from_object
  Eigen::Vector3d half;       ///< half-lengths, meters
  Eigen::Matrix3d by_vector;  ///< the turn in the frame of the object, by the rotation vector
};

/// Converts the derivatives of edges to derivatives by the tangent of the pose and by the body.
template <typename Pose>
void ByPoseAndLandmark(const BodyEdgeDerivatives& edges,
                       const Station& station,
                       const Mount& mount,
                       const Unpacked<BodyModel>& body,
                       Eigen::Matrix<double, kBoxSize, Pose::kTangentSize>* by_pose,
                       Eigen::Matrix<double, kBoxSize, kLandmarkSize>* by_landmark) {
  const Matrix3<double>& R = station.world_from_robot.rotation;
  const Eigen::Vector3d arm = body.surface.center - station.world_from_robot.translation;
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const double a = edges.by_center[edge];
    const Eigen::Vector3d v = edges.by_factor.col(edge);
    const Eigen::Vector3d k = mount.camera_from_robot.transpose() * edges.normal.col(edge);
    const Eigen::Vector3d m = R * k;
    const Eigen::Vector3d turn =
        k.cross(R.transpose() * Eigen::Vector3d(a * arm + body.surface.factor * v));
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      by_pose->row(edge) << -a * k.x(), -a * k.y(), turn.z();
    } else {
      by_pose->row(edge) << -a * k.transpose(), turn.transpose();
    }
    const Eigen::Vector3d local = body.rotation.transpose() * m;
    const Eigen::Vector3d arms = body.half.cwiseProduct(v);
    by_landmark->row(edge) << a * m.transpose(), local.cwiseProduct(arms).transpose(),
        (body.by_vector.transpose() * arms.cross(local)).transpose();
  }
}

}  // namespace dqslam
