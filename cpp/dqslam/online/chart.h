// Coordinates of an object in which information adds up.
//
//   chart   [cx, cy, cz, S00, S01, S02, S11, S12, S22]: centre and shape.  A Gaussian in it needs
//   no
//           transport when the object moves, and it is the space in which EllipsoidManifold goes
//           straight.
#pragma once

#include "dqslam/ellipsoid.h"

namespace dqslam::online {

using Matrix9d = Eigen::Matrix<double, 9, 9>;

template <typename T>
Matrix3<T> ShapeOf(const T* chart) {
  Matrix3<T> shape;
  shape << chart[3], chart[4], chart[5], chart[4], chart[6], chart[7], chart[5], chart[7], chart[8];
  return shape;
}

inline Surface<double> SurfaceOf(const Vector9d& chart) {
  return {chart.head<3>(), ShapeOf(chart.data())};
}

Vector9d ChartFromSurface(const Surface<double>& surface);
Vector9d ChartFromEllipsoid(const Vector9d& ellipsoid);

/// Log-Cholesky parameters, with derivatives where T has them.  The shape is positive definite.
template <typename T>
void EllipsoidFromChart(const T* chart, T* ellipsoid) {
  using std::log, std::sqrt;
  const T l00 = sqrt(chart[3]), l10 = chart[4] / l00, l20 = chart[5] / l00;
  const T l11 = sqrt(chart[6] - l10 * l10), l21 = (chart[7] - l10 * l20) / l11;
  const T l22 = sqrt(chart[8] - l20 * l20 - l21 * l21);
  for (int i = 0; i < 3; ++i) ellipsoid[i] = chart[i];
  ellipsoid[3] = log(l00);
  ellipsoid[4] = log(l11);
  ellipsoid[5] = log(l22);
  ellipsoid[6] = l10;
  ellipsoid[7] = l20;
  ellipsoid[8] = l21;
}

/// chart + step, bent where that would not be an ellipsoid any more; false where rounding wins.
bool Move(const Vector9d& chart, const Vector9d& step, Vector9d* result);

/// Information in the chart from that in log-Cholesky parameters at the same object.
Matrix9d InformationInChart(const Vector9d& chart, const Matrix9d& of_ellipsoid);

}  // namespace dqslam::online
