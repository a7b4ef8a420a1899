// Coordinates of an ellipsoid in which information adds up.
//
//   center_shape  [cx, cy, cz, S00, S01, S02, S11, S12, S22]: center and shape, in the world.
//
// A Gaussian in these coordinates needs no transport when the object moves, because
// EllipsoidManifold moves along straight lines in them.
#pragma once

#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

template <typename T>
Matrix3<T> ShapeOf(const T* center_shape) {
  Matrix3<T> shape;
  shape << center_shape[3], center_shape[4], center_shape[5], center_shape[4], center_shape[6],
      center_shape[7], center_shape[5], center_shape[7], center_shape[8];
  return shape;
}

inline Surface<double> SurfaceOf(const Vector9d& center_shape) {
  return {center_shape.head<3>(), ShapeOf(center_shape.data())};
}

Vector9d CenterShapeFromSurface(const Surface<double>& surface);
Vector9d CenterShapeFromEllipsoid(const Vector9d& ellipsoid);

/// Log-Cholesky parameters, with derivatives if T has them.  The shape must be positive definite.
template <typename T>
void EllipsoidFromCenterShape(const T* center_shape, T* ellipsoid) {
  using std::log, std::sqrt;
  const T l00 = sqrt(center_shape[3]), l10 = center_shape[4] / l00, l20 = center_shape[5] / l00;
  const T l11 = sqrt(center_shape[6] - l10 * l10), l21 = (center_shape[7] - l10 * l20) / l11;
  const T l22 = sqrt(center_shape[8] - l20 * l20 - l21 * l21);
  for (int i = 0; i < 3; ++i) ellipsoid[i] = center_shape[i];
  ellipsoid[3] = log(l00);
  ellipsoid[4] = log(l11);
  ellipsoid[5] = log(l22);
  ellipsoid[6] = l10;
  ellipsoid[7] = l20;
  ellipsoid[8] = l21;
}

/// center_shape + step, or the result of EllipsoidManifold::Plus if the sum may be no ellipsoid.
/// Returns false if rounding makes the result infinite or flat.
bool RetractCenterShape(const Vector9d& center_shape, const Vector9d& step, Vector9d* result);

/// Converts the information of an object in log-Cholesky parameters to these coordinates.
Matrix9d InformationInCenterShape(const Vector9d& center_shape, const Matrix9d& of_ellipsoid);

}  // namespace dqslam
