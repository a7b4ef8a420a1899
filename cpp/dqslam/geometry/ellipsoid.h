// Landmark models and their projection.
//
//   Q* = [ c c^T - S   c ]     c center, S shape [m^2]; an ellipsoid when S is positive definite.
//        [   c^T       1 ]     [S&M17] eq. (2)
//
// Both models unpack to (c, S), and all geometry below is written for (c, S):
//   EllipsoidModel    S = L L^T by construction (log-Cholesky)
//   DualQuadricModel  S = c c^T - Q*_33, of any signature, as in the paper
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"

namespace dqslam {

enum class LandmarkModel { kDualQuadric, kEllipsoid };

/// A quadric surface by center and shape, in the frame that the name of the variable has.
template <typename T>
struct Surface {
  Vector3<T> center;
  Matrix3<T> shape;
};

struct EllipsoidModel {
  static constexpr LandmarkModel kModel = LandmarkModel::kEllipsoid;

  template <typename T>
  static Surface<T> Unpack(const T* e) {
    using std::exp;
    const T l00 = exp(e[3]), l11 = exp(e[4]), l22 = exp(e[5]);
    const T &l10 = e[6], &l20 = e[7], &l21 = e[8];
    Surface<T> surface;
    surface.center << e[0], e[1], e[2];
    Matrix3<T>& S = surface.shape;
    S(0, 0) = l00 * l00;
    S(0, 1) = S(1, 0) = l00 * l10;
    S(0, 2) = S(2, 0) = l00 * l20;
    S(1, 1) = l10 * l10 + l11 * l11;
    S(1, 2) = S(2, 1) = l10 * l20 + l11 * l21;
    S(2, 2) = l20 * l20 + l21 * l21 + l22 * l22;
    return surface;
  }
};

struct DualQuadricModel {
  static constexpr LandmarkModel kModel = LandmarkModel::kDualQuadric;

  template <typename T>
  static Surface<T> Unpack(const T* q) {
    Surface<T> surface;
    surface.center << q[3], q[6], q[8];
    Matrix3<T> upper_left;
    upper_left << q[0], q[1], q[2], q[1], q[4], q[5], q[2], q[5], q[7];
    surface.shape = surface.center * surface.center.transpose() - upper_left;
    return surface;
  }
};

/// The surface in the frame of a camera.
template <typename T>
Surface<T> ToCamera(const CameraInWorld<T>& camera, const Surface<T>& in_world) {
  Surface<T> in_camera;
  in_camera.center = camera.camera_from_world * (in_world.center - camera.position);
  in_camera.shape =
      camera.camera_from_world * in_world.shape * camera.camera_from_world.transpose();
  return in_camera;
}

/// Whether every point of the ellipsoid has positive depth.  This excludes ellipsoids behind the
/// camera, around it and across its plane.
template <typename T>
bool StrictlyInFront(const Surface<T>& in_camera) {
  const T& depth = in_camera.center.z();
  return depth > T(0) && depth * depth > in_camera.shape(2, 2);
}

/// Exact bounding box of the outline in the image [px].  Returns false unless strictly in front.
///   x = (B -+ sqrt(B^2 - A D)) / D,  A = S_xx - p_x^2, B = S_xz - p_x p_z, D = S_zz - p_z^2 < 0
template <typename T>
bool ProjectToBox(const Surface<T>& in_camera, const Camera& camera, Vector4<T>* box) {
  using std::sqrt;
  if (!StrictlyInFront(in_camera)) return false;
  const Vector3<T>& p = in_camera.center;
  const Matrix3<T>& S = in_camera.shape;
  const T D = S(2, 2) - p.z() * p.z();
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  for (int axis = 0; axis < 2; ++axis) {
    const T A = S(axis, axis) - p[axis] * p[axis];
    const T B = S(axis, 2) - p[axis] * p.z();
    const T discriminant = B * B - A * D;
    if (!(discriminant > T(0))) return false;
    const T root = sqrt(discriminant);
    const T scale = focal[axis] / D;
    (*box)[axis] = (B + root) * scale + principal[axis];
    (*box)[axis + 2] = (B - root) * scale + principal[axis];
  }
  return true;
}

/// Outward distance of the surface from the plane through each edge of a box, converted to pixels
/// at the given depth: focal (n.p + |L^T n|) / depth with n = (+-1, 0, -+x) or (0, +-1, -+y).  It
/// is negative if the object ends inside the box, zero at tangency, and positive if the object
/// extends beyond the edge.  Returns false if n^T S n is not positive.
template <typename T>
bool TangentDistances(const Surface<T>& in_camera,
                      const Camera& camera,
                      const Eigen::Vector4d& box,
                      double depth,
                      Vector4<T>* distances) {
  using std::sqrt;
  const Vector3<T>& p = in_camera.center;
  const Matrix3<T>& S = in_camera.shape;
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  for (int edge = 0; edge < 4; ++edge) {
    const int axis = edge % 2;
    const double outward = edge < 2 ? -1 : 1;
    const double x = (box[edge] - principal[axis]) / focal[axis];
    const T squared = S(axis, axis) - 2 * x * S(axis, 2) + x * x * S(2, 2);
    if (!(squared > T(0))) return false;
    (*distances)[edge] = focal[axis] / depth * (outward * (p[axis] - x * p.z()) + sqrt(squared));
  }
  return true;
}

/// The depth for TangentDistances [m].  It is that of the center, but at least 1.5 times the
/// object's extent in depth from its center, so that an object behind the camera still has a scale.
double TangentDepth(const Surface<double>& in_camera);

/// The point at which the outline touches each edge of its bounding box [px], one (u, v) per row.
/// It is the pole of the edge's line.  The box is that of ProjectToBox.
Eigen::Matrix<double, 4, 2> TouchingPoints(const Surface<double>& in_camera,
                                           const Camera& camera,
                                           const Eigen::Vector4d& box);

/// The signs that make errors positive outwards, by edge: for predicted - observed boxes, and for
/// the distances of TangentDistances.
inline constexpr double kBoxOutward[] = {-1, -1, 1, 1}, kTangentOutward[] = {1, 1, 1, 1};

/// Whether an error does not count because the edge is one-sided.  Such an edge only shows that the
/// object reaches at least to it, so its error counts only if the prediction ends inside.
template <typename T>
bool IsBeyond(bool one_sided, double outward, const T& error) {
  return one_sided && T(outward) * error > T(0);
}

/// Sets errors to zero that do not count.
template <typename T>
void IgnoreBeyond(const EdgeFlags& one_sided,
                  Vector4<T>* error,
                  const double (&outward)[kBoxSize] = kBoxOutward) {
  for (int edge = 0; edge < kBoxSize; ++edge) {
    if (IsBeyond(one_sided[edge], outward[edge], (*error)[edge])) (*error)[edge] = T(0);
  }
}

/// Dual quadric [q1 .. q9] of a surface in the same frame.
Vector9d DualQuadricFromSurface(const Surface<double>& surface);

/// Log-Cholesky parameters of a surface.  Throws std::invalid_argument if it is no ellipsoid.
Vector9d EllipsoidFromSurface(const Surface<double>& surface);

/// Dual quadric of an ellipsoid.  The conversion is exact.
Vector9d DualQuadricFromEllipsoid(const Vector9d& ellipsoid);
/// Ellipsoid of a dual quadric.  Throws std::invalid_argument if the quadric is no ellipsoid.
Vector9d EllipsoidFromDualQuadric(const Vector9d& quadric);

/// The 4 x 4 matrix Q* of q.  [S&M17] eq. (2)
Eigen::Matrix4d DualQuadricMatrix(const Vector9d& quadric);

/// Center, semi-axes [m] and the rotation world_from_object, as a quaternion x y z w.
struct EllipsoidAxes {
  Eigen::Vector3d center;
  Eigen::Vector3d semi_axes;  ///< descending
  Eigen::Vector4d orientation_xyzw;
};

Vector9d EllipsoidFromAxes(const Eigen::Vector3d& center,
                           const Eigen::Vector3d& semi_axes,
                           const Eigen::Vector4d& orientation_xyzw);
EllipsoidAxes AxesFromEllipsoid(const Vector9d& ellipsoid);

/// A sphere of the given radius [m] as an ellipsoid.
Vector9d Sphere(const Eigen::Vector3d& center, double radius);

}  // namespace dqslam
