// Bodies other than ellipsoids: boxes and cans.
//
//   body = { c + A u },  A = R diag(h),  with u in the unit cube, or in the unit cylinder, whose
//   axis is its third.  The width along a normal n is h(n) = |A^T n|, with the norm that belongs to
//   u: the 1-norm for a cuboid, and for a cylinder the 2-norm across plus the absolute value along.
//   An ellipsoid has the 2-norm.
//
// Parameters [9]: center c [m], logarithms of the half-lengths h [log m], rotation vector of
// R = world_from_object [rad].  Steps add to them.
#pragma once

#include <ceres/jet.h>
#include <ceres/rotation.h>

#include <Eigen/Core>
#include <cmath>
#include <type_traits>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/shape.h"

namespace dqslam {

/// A cuboid or a cylinder, in the frame that the name of the variable has.
template <typename T>
struct Body {
  Shape shape;
  double rounding;  ///< see Width
  Vector3<T> center;
  Matrix3<T> factor;  ///< A, whose columns are the half-lengths along the axes of the object
};

/// How the parameters of a cuboid or a cylinder are read.
struct BodyModel {
  static constexpr LandmarkModel kModel = LandmarkModel::kEllipsoid;
  Shape shape = Shape::kCuboid;
  double rounding = 0;

  template <typename T>
  Body<T> Unpack(const T* parameters) const {
    using std::exp;
    Body<T> body{
        shape, rounding, Vector3<T>(parameters[0], parameters[1], parameters[2]), Matrix3<T>()};
    ceres::AngleAxisToRotationMatrix(parameters + 6, body.factor.data());  // column by column
    for (int axis = 0; axis < 3; ++axis) body.factor.col(axis) *= exp(parameters[3 + axis]);
    return body;
  }
};

/// The model that is estimated.  Its edges are so little rounded that a box is off by a thousandth.
inline BodyModel RoundedModel(Shape shape) {
  return {shape, 0.005};
}

template <typename T>
Body<T> ToCamera(const CameraInWorld<T>& camera, const Body<T>& in_world) {
  return {in_world.shape,
          in_world.rounding,
          camera.camera_from_world * (in_world.center - camera.position),
          camera.camera_from_world * in_world.factor};
}

/// The width of a body along n is a norm of v = A^T n.  The function computes it with its gradient
/// u, and the body touches the tangent plane with the normal n at c + A u.
///
/// A box of a body with sharp edges has a kink wherever one corner takes over from another, at
/// which minimizers stop.  With the rounding e > 0, each absolute value |v_i| is therefore v_i^2 /
/// sqrt(v_i^2 + e^2 |v|^2), which is smooth, exact at zero, and off by e^2 / 2 beyond.
template <typename T>
T Width(Shape shape, double rounding, const Vector3<T>& v, Vector3<T>* gradient) {
  using std::sqrt;
  const T squares[3] = {v[0] * v[0], v[1] * v[1], v[2] * v[2]};
  const T e = T(rounding * rounding) * (squares[0] + squares[1] + squares[2]);
  T width(0), by_e(0);
  *gradient = Vector3<T>::Zero();
  // Adds the rounded root of the sum of squares from `first` to `last`.
  const auto add = [&](int first, int last) {
    T squared = squares[first];
    for (int i = first + 1; i <= last; ++i) squared += squares[i];
    const T sum = squared + e;
    if (!(sum > T(0))) return;
    const T root = sqrt(sum), slope = (squared + T(2) * e) / (sum * root);
    width += squared / root;
    for (int i = first; i <= last; ++i) (*gradient)[i] += v[i] * slope;
    by_e -= squared / (sum * root);
  };
  if (shape == Shape::kCuboid) {
    add(0, 0);
    add(1, 1);
  } else {
    add(0, 1);
  }
  add(2, 2);
  *gradient += v * (T(rounding * rounding) * by_e);
  return width;
}

template <typename T>
T Width(const Body<T>& body, const Vector3<T>& normal) {
  Vector3<T> gradient;
  return Width(body.shape, body.rounding, Vector3<T>(body.factor.transpose() * normal), &gradient);
}

/// Whether every point of the body has positive depth.
template <typename T>
bool StrictlyInFront(const Body<T>& in_camera) {
  return in_camera.center.z() > Width(in_camera, Vector3<T>(T(0), T(0), T(1)));
}

/// The slope x of the image line through an edge of the box (x = u or v over depth, by `axis`), and
/// the depth of the point that touches it.  It is the zero of F(x) = outward n.c + |A^T n| for the
/// normal n = e - x e_z.  F is convex and falls outwards, so Newton's method from the center
/// approaches the zero from one side.
struct TouchingLine {
  double slope, depth;
  Eigen::Vector3d u;  ///< of the touching point c + outward A u
};
TouchingLine FindTouchingLine(const Body<double>& in_camera, int axis, double outward);

/// The values without their derivatives.
inline const Body<double>& ValueOf(const Body<double>& body) {
  return body;
}
template <typename T, int N>
Body<double> ValueOf(const Body<ceres::Jet<T, N>>& body) {
  const auto value = [](const ceres::Jet<T, N>& jet) { return jet.a; };
  return {body.shape, body.rounding, body.center.unaryExpr(value), body.factor.unaryExpr(value)};
}

/// Exact bounding box of the body's image [px].  Returns false unless strictly in front.
template <typename T>
bool ProjectToBox(const Body<T>& in_camera, const Camera& camera, Vector4<T>* box) {
  const Body<double> value = ValueOf(in_camera);
  if (!StrictlyInFront(value)) return false;
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    const double outward = edge < 2 ? -1 : 1;
    const TouchingLine line = FindTouchingLine(value, axis, outward);
    T slope(line.slope);
    if constexpr (!std::is_same_v<T, double>) {  // One more step has the derivatives of the zero.
      Vector3<T> normal = Vector3<T>::Zero();
      normal[axis] = T(1);
      normal.z() = T(-line.slope);
      const T distance = outward * normal.dot(in_camera.center) + Width(in_camera, normal);
      slope += T(outward / line.depth) * distance;
    }
    (*box)[edge] = focal[axis] * slope + principal[axis];
  }
  return true;
}

/// What TangentDistances of an ellipsoid is: focal (n.p + h(n)) / depth for each edge.
template <typename T>
bool TangentDistances(const Body<T>& in_camera,
                      const Camera& camera,
                      const Eigen::Vector4d& box,
                      double depth,
                      Vector4<T>* distances) {
  const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    const double outward = edge < 2 ? -1 : 1;
    const double x = (box[edge] - principal[axis]) / focal[axis];
    Vector3<T> normal = Vector3<T>::Zero();
    normal[axis] = T(1);
    normal.z() = T(-x);
    (*distances)[edge] =
        focal[axis] / depth * (outward * normal.dot(in_camera.center) + Width(in_camera, normal));
  }
  return true;
}

/// The depth for TangentDistances [m], as that of an ellipsoid.
double TangentDepth(const Body<double>& in_camera);

/// The image of a point at which the body touches each edge of its box [px], one (u, v) per row.
/// The box is that of ProjectToBox.
Eigen::Matrix<double, 4, 2> TouchingPoints(const Body<double>& in_camera,
                                           const Camera& camera,
                                           const Eigen::Vector4d& box);

/// The ellipsoid with the same center and the same second moments as the solid body.  Where
/// only an ellipsoid can be shown or compared, it stands for the body.
Surface<double> EquivalentEllipsoid(const Body<double>& body);

/// Parameters of a body.  `rotation` is world_from_object.
Vector9d BodyParameters(const Eigen::Vector3d& center,
                        const Eigen::Vector3d& half_lengths,
                        const Eigen::Matrix3d& rotation);

}  // namespace dqslam
