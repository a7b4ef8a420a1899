// Where objects of a scene stand: on planes of unknown height, on each other, beside each other,
// and turned alike.  n is the unit vector up, c an object's center, h its half height along n, and
// S its shape matrix (of a cuboid or a cylinder: that of the ellipsoid in it).
//
//   OnPlaneCost    r = (n.c - h - height - s) / sigma.  The lowest point is on the plane
//                  {x : n.x = height + s}, where s is shared by all objects on it.
//   OnObjectCost   r = (n.c - h - n.c' - h') / sigma.  The lowest point is as high as the highest
//                  point of the other object.
//   BesideCost     r = max(0, d - distance) / sigma, for the horizontal distance d of the centers.
//   AlignedCost    r = sin(4 a) / (4 sigma), for the angle a between the horizontal axes of the two
//                  objects, of which 0 and 90 degrees are the same.  It is 0 where the outline of
//                  one, seen from above, is round.
//   PlumbCost      r = cross(n, S n) / (n^T S n sigma), as UprightCost.
//
// Each may be wrong, and is bounded as in costs/bounded.h.
//
// Blocks: object [9], shared [1]; object, object (three times); object.  Residuals in sigmas.
// None of them fails.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/bounded.h"
#include "dqslam/geometry/body.h"

namespace dqslam {

/// What placements ask of an object.
template <typename T>
struct Standing {
  Vector3<T> center;
  Matrix3<T> shape;
  T half_height;
};

template <typename T>
Standing<T> Stand(const Surface<T>& object, const Vector3<T>& up) {
  using std::sqrt;
  return {object.center, object.shape, sqrt(up.dot(object.shape * up))};
}

template <typename T>
Standing<T> Stand(const Body<T>& object, const Vector3<T>& up) {
  return {object.center, object.factor * object.factor.transpose(), Width(object, up)};
}

template <typename Model>
struct OnPlaneCost : AutoDiffCost<OnPlaneCost<Model>, 1, kLandmarkSize, 1> {
  Model model;
  Eigen::Vector3d up;
  double height;  ///< meters
  double sigma;   ///< meters

  template <typename T>
  bool operator()(const T* object, const T* shared, T* residual) const {
    const Vector3<T> n = up.cast<T>();
    const Standing<T> it = Stand<T>(model.Unpack(object), n);
    residual[0] = (n.dot(it.center) - it.half_height - T(height) - shared[0]) / T(sigma);
    BoundBySwitch(1, residual);
    return true;
  }
};

template <typename Model, typename Other>
struct OnObjectCost : AutoDiffCost<OnObjectCost<Model, Other>, 1, kLandmarkSize, kLandmarkSize> {
  Model model;
  Other other_model;
  Eigen::Vector3d up;
  double sigma;  ///< meters

  template <typename T>
  bool operator()(const T* object, const T* other, T* residual) const {
    const Vector3<T> n = up.cast<T>();
    const Standing<T> it = Stand<T>(model.Unpack(object), n);
    const Standing<T> below = Stand<T>(other_model.Unpack(other), n);
    residual[0] = (n.dot(it.center - below.center) - it.half_height - below.half_height) / T(sigma);
    BoundBySwitch(1, residual);
    return true;
  }
};

template <typename Model, typename Other>
struct BesideCost : AutoDiffCost<BesideCost<Model, Other>, 1, kLandmarkSize, kLandmarkSize> {
  Model model;
  Other other_model;
  Eigen::Vector3d up;
  double distance;  ///< meters
  double sigma;     ///< meters

  template <typename T>
  bool operator()(const T* object, const T* other, T* residual) const {
    const Vector3<T> between = model.Unpack(object).center - other_model.Unpack(other).center;
    const Vector3<T> n = up.cast<T>();
    const Vector3<T> horizontal = between - n * n.dot(between);
    residual[0] = T(0);
    if (horizontal.squaredNorm() > T(distance * distance)) {
      residual[0] = (horizontal.norm() - T(distance)) / T(sigma);
    }
    BoundBySwitch(1, residual);
    return true;
  }
};

template <typename Model, typename Other>
struct AlignedCost : AutoDiffCost<AlignedCost<Model, Other>, 1, kLandmarkSize, kLandmarkSize> {
  Model model;
  Other other_model;
  Eigen::Vector3d up;
  double sigma;  ///< radians

  template <typename T>
  bool operator()(const T* object, const T* other, T* residual) const {
    using std::sqrt;
    // The direction of twice the angle of the longest axis, times how far the outline is from
    // round.
    T x[2], y[2];
    Outline(Stand<T>(model.Unpack(object), up.cast<T>()).shape, &x[0], &y[0]);
    Outline(Stand<T>(other_model.Unpack(other), up.cast<T>()).shape, &x[1], &y[1]);
    // An outline whose axes differ by less than a few percent has no direction.
    constexpr double kRound = 0.05;
    const T squares = (x[0] * x[0] + y[0] * y[0] + T(kRound * kRound)) *
                      (x[1] * x[1] + y[1] * y[1] + T(kRound * kRound));
    const T sine = (x[0] * y[1] - y[0] * x[1]) / sqrt(squares);  // of 2 a
    const T cosine = (x[0] * x[1] + y[0] * y[1]) / sqrt(squares);
    residual[0] = sine * cosine / T(2 * sigma);
    BoundBySwitch(1, residual);
    return true;
  }

  template <typename T>
  void Outline(const Matrix3<T>& shape, T* x, T* y) const {
    const Eigen::Vector3d e1 = up.unitOrthogonal(), e2 = up.cross(e1);
    const T a = e1.cast<T>().dot(shape * e1.cast<T>());
    const T b = e1.cast<T>().dot(shape * e2.cast<T>());
    const T d = e2.cast<T>().dot(shape * e2.cast<T>());
    *x = (a - d) / (a + d);
    *y = T(2) * b / (a + d);
  }
};

template <typename Model>
struct PlumbCost : AutoDiffCost<PlumbCost<Model>, 3, kLandmarkSize> {
  Model model;
  Eigen::Vector3d up;
  double sigma;  ///< radians of tilt

  template <typename T>
  bool operator()(const T* object, T* residual) const {
    const Vector3<T> n = up.cast<T>();
    const Matrix3<T> shape = Stand<T>(model.Unpack(object), n).shape;
    const Vector3<T> image = shape * n;
    Eigen::Map<Vector3<T>> r(residual);
    r = n.cross(image) / (n.dot(image) * T(sigma));
    BoundBySwitch(3, residual);
    return true;
  }
};

}  // namespace dqslam
