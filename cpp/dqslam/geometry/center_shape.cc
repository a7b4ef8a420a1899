#include "dqslam/geometry/center_shape.h"

#include "dqslam/geometry/jets.h"
#include "dqslam/geometry/manifolds.h"

namespace dqslam {
namespace {

// EllipsoidFromCenterShape() as a functor.
struct ToEllipsoid {
  static constexpr int kResidualSize = kLandmarkSize;
  template <typename T>
  bool operator()(const T* center_shape, T* ellipsoid) const {
    EllipsoidFromCenterShape(center_shape, ellipsoid);
    return true;
  }
};

// d log-Cholesky / d center_shape.
Matrix9d JacobianOfEllipsoid(const Vector9d& center_shape, Vector9d* ellipsoid) {
  Matrix9d jacobian;
  Differentiate(ToEllipsoid(), ellipsoid, &jacobian, ObjectParameters{center_shape.data()});
  return jacobian;
}

}  // namespace

Vector9d CenterShapeFromSurface(const Surface<double>& surface) {
  const Matrix3<double>& S = surface.shape;
  Vector9d center_shape;
  center_shape << surface.center, S(0, 0), S(0, 1), S(0, 2), S(1, 1), S(1, 2), S(2, 2);
  return center_shape;
}

Vector9d CenterShapeFromEllipsoid(const Vector9d& ellipsoid) {
  return CenterShapeFromSurface(EllipsoidModel::Unpack(ellipsoid.data()));
}

bool RetractCenterShape(const Vector9d& center_shape, const Vector9d& step, Vector9d* result) {
  // Against the smallest eigenvalue, by the determinant and the trace: no decomposition is needed
  // while the shape changes little.
  const Matrix3<double> S = ShapeOf(center_shape.data()), dS = ShapeOf(step.data());
  const double trace = S.trace();
  if (dS.norm() < 2 * S.determinant() / (trace * trace)) {
    *result = center_shape + step;
    return result->allFinite();
  }
  Vector9d ellipsoid, moved;
  const Vector9d tangent = JacobianOfEllipsoid(center_shape, &ellipsoid) * step;
  if (!EllipsoidManifold().Plus(ellipsoid.data(), tangent.data(), moved.data())) return false;
  *result = CenterShapeFromEllipsoid(moved);
  return result->allFinite();
}

Matrix9d InformationInCenterShape(const Vector9d& center_shape, const Matrix9d& of_ellipsoid) {
  Vector9d ellipsoid;
  const Matrix9d jacobian = JacobianOfEllipsoid(center_shape, &ellipsoid);
  return jacobian.transpose() * of_ellipsoid * jacobian;
}

}  // namespace dqslam
