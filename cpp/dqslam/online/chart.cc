#include "dqslam/online/chart.h"

#include "dqslam/costs/autodiff.h"
#include "dqslam/manifolds.h"

namespace dqslam::online {
namespace {

// d log-Cholesky / d chart.
Matrix9d JacobianOfEllipsoid(const Vector9d& chart, Vector9d* ellipsoid) {
  ceres::Jet<double, 9> in[9], out[9];
  PlainJets<9>(chart.data(), 0, in);
  EllipsoidFromChart(in, out);
  Matrix9d jacobian;
  SplitJets(out, ellipsoid, &jacobian);
  return jacobian;
}

}  // namespace

Vector9d ChartFromSurface(const Surface<double>& surface) {
  const Matrix3<double>& S = surface.shape;
  Vector9d chart;
  chart << surface.center, S(0, 0), S(0, 1), S(0, 2), S(1, 1), S(1, 2), S(2, 2);
  return chart;
}

Vector9d ChartFromEllipsoid(const Vector9d& ellipsoid) {
  return ChartFromSurface(EllipsoidModel::Unpack(ellipsoid.data()));
}

bool Move(const Vector9d& chart, const Vector9d& step, Vector9d* result) {
  // Against the smallest eigenvalue, by the determinant and the trace: no decomposition is needed
  // while the shape changes little.
  const Matrix3<double> S = ShapeOf(chart.data()), dS = ShapeOf(step.data());
  const double trace = S.trace();
  if (dS.norm() < 2 * S.determinant() / (trace * trace)) {
    *result = chart + step;
    return result->allFinite();
  }
  Vector9d ellipsoid, moved;
  const Vector9d tangent = JacobianOfEllipsoid(chart, &ellipsoid) * step;
  if (!EllipsoidManifold().Plus(ellipsoid.data(), tangent.data(), moved.data())) return false;
  *result = ChartFromEllipsoid(moved);
  return result->allFinite();
}

Matrix9d InformationInChart(const Vector9d& chart, const Matrix9d& of_ellipsoid) {
  Vector9d ellipsoid;
  const Matrix9d jacobian = JacobianOfEllipsoid(chart, &ellipsoid);
  return jacobian.transpose() * of_ellipsoid * jacobian;
}

}  // namespace dqslam::online
