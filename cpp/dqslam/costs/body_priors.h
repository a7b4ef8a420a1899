// Knowledge of cuboids and cylinders beyond their boxes, as for ellipsoids in costs/size_prior.h
// and costs/scene_priors.h.
//
//   BodySizeCost     r_i = (log h_i - log_mean) / log_sigma for the three half-lengths.
//   RoundCost        A cylinder is round: r_1 = log(h_1 / h_2) / 0.05.  Its turn about its axis is
//                    then unknown, and r_2 = w_3 / 1 rad of its rotation vector w keeps it in
//                    place.
//   BodyUprightCost  With v = R^T n the entries are the products v_j v_k / sigma of two axes.  They
//                    are zero when n is an axis, and for a small tilt [rad] one is the tilt.  Of a
//                    cylinder only its own axis counts, or all that lie across it.
//   BodyStandsCost   The same, bounded as in costs/bounded.h: the body stands upright unless its
//                    boxes show that it does not.
//   BodySupportCost  r = (n.c + d - h(n)) / sigma.  It is zero when the lowest point lies on the
//                    plane {x : n.x + d = 0}.
//
// Blocks: body [9].  Residuals: [3], [2], [3], [3], [1], in sigmas.  None of them fails.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/bounded.h"
#include "dqslam/geometry/body.h"

namespace dqslam {

struct BodySizeCost : AutoDiffCost<BodySizeCost, 3, kLandmarkSize> {
  double log_mean;   ///< log meters
  double log_sigma;  ///< log meters

  template <typename T>
  bool operator()(const T* body, T* residual) const {
    for (int i = 0; i < 3; ++i) residual[i] = (body[3 + i] - T(log_mean)) / T(log_sigma);
    return true;
  }
};

struct RoundCost : AutoDiffCost<RoundCost, 2, kLandmarkSize> {
  static constexpr double kLogSigma = 0.05;

  template <typename T>
  bool operator()(const T* body, T* residual) const {
    residual[0] = (body[3] - body[4]) / T(kLogSigma);
    residual[1] = body[8];
    return true;
  }
};

struct BodyUprightCost : AutoDiffCost<BodyUprightCost, 3, kLandmarkSize> {
  Shape shape;
  Eigen::Vector3d up;
  double sigma;  ///< radians of tilt

  template <typename T>
  bool operator()(const T* body, T* residual) const {
    using std::sqrt;
    Matrix3<T> R;  // world_from_object
    ceres::AngleAxisToRotationMatrix(body + 6, R.data());
    const Vector3<T> v = R.transpose() * up.cast<T>();
    residual[0] = v[1] * v[2] / T(sigma);
    residual[1] = v[0] * v[2] / T(sigma);
    residual[2] = shape == Shape::kCuboid ? T(v[0] * v[1] / T(sigma)) : T(0);
    return true;
  }
};

struct BodyStandsCost : AutoDiffCost<BodyStandsCost, 3, kLandmarkSize> {
  BodyUprightCost upright;

  template <typename T>
  bool operator()(const T* body, T* residual) const {
    upright(body, residual);
    BoundBySwitch(3, residual);
    return true;
  }
};

struct BodySupportCost : AutoDiffCost<BodySupportCost, 1, kLandmarkSize> {
  Shape shape;
  Eigen::Vector3d up;
  double offset;  ///< d, meters
  double sigma;   ///< meters

  template <typename T>
  bool operator()(const T* parameters, T* residual) const {
    const Body<T> body = BodyModel{shape}.Unpack(parameters);
    const Vector3<T> n = up.cast<T>();
    residual[0] = (n.dot(body.center) + T(offset) - Width(body, n)) / T(sigma);
    return true;
  }
};

}  // namespace dqslam
