// Residuals and their derivatives by the tangent of the pose and the chart of the object.
//
// An edge x of the outline in the camera frame, with n = (1, 0, -x) (or (0, 1, -y)), fulfils
// n.S n = (n.p)^2, p and S in the camera frame.  Differentiated:
//   dx = ((n.p) n.dp - n.dS n / 2) / e,   e = D x - B = +-sqrt(B^2 - A D)  (see ProjectToBox)
// With v = S n, all in the robot frame, and q the centre there:
//   by the centre a n;  by S  b n n^T;  by the pose's translation  -a n;  by its rotation
//   -a q x n - 2 b v x n;  with a = (n.p) / e and b = -1 / (2 e).
// Where the object is not strictly in front, the tangent residual takes the place of the box's, see
// costs/tangent.h: n.p + |L^T n| with the n of the observed edge, hence a = +-1, b = 1 / (2 |L^T
// n|).
#pragma once

#include "dqslam/graph.h"
#include "dqslam/online/history.h"

namespace dqslam::online {

/// What all residuals share.
struct Model {
  Model(const Camera& camera, const ScenePriors& scene, double loss_scale)
      : camera(camera), mount(camera), scene(scene), loss_scale(loss_scale) {}
  Camera camera;
  Mount mount;
  ScenePriors scene;
  double loss_scale;  ///< of the Cauchy loss, sigmas of a whole box; 0 for least squares
};

/// A pose, ready for all that was seen from it.
struct Stand {
  Rigid<double> world_from_robot;
  CameraInWorld<double> camera;
};

template <typename Pose>
Stand StandAt(const Model& model, const double* pose) {
  return {Pose::WorldFromRobot(pose), LocateCamera<Pose>(pose, model.mount)};
}

template <typename Pose>
struct Linear {
  Eigen::Vector4d residual;
  Eigen::Matrix<double, 4, Pose::kTangentSize> by_pose;
  Eigen::Matrix<double, 4, 9> by_object;
  double cost;   ///< after the loss, which scales the rest
  double depth;  ///< of the tangent residual [m], 0 where it is the box's
};

/// Takes the components of a tangent of SE(3) that the pose model has.
template <typename Pose, typename Row>
void SetTangent(const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation, Row&& row) {
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    row << translation.x(), translation.y(), rotation.z();
  } else {
    row << translation.transpose(), rotation.transpose();
  }
}

/// Cost of a sight after the loss, and its chi-square before; with the residual that Linearize()
/// used, of that depth.  Infinite where it is the box's and the object is not strictly in front.
double CostOfSight(const Model& model,
                   const Stand& stand,
                   const Sight& sight,
                   const Vector9d& chart,
                   double depth,
                   double* chi_square);

/// Which residual a box has where its object is in front; elsewhere it is the tangent's.
enum class Edges { kBox, kTangent };

/// The residual with derivatives.
template <typename Pose>
void Linearize(const Model& model,
               const Stand& stand,
               const Sight& sight,
               const Vector9d& chart,
               Edges edges,
               Linear<Pose>* linear);

/// Residual and derivatives by the tangents of both poses, (k, 2 k).
template <typename Pose>
struct LinearStep {
  static constexpr int k = Pose::kTangentSize;
  Eigen::Matrix<double, k, 1> residual;
  Eigen::Matrix<double, k, k> by_from, by_to;
};

template <typename Pose>
LinearStep<Pose> LinearizeStep(const typename History<Pose>::Step& step,
                               const double* from,
                               const double* to);

/// Half the squared distance of a step from its measurement, in sigmas.
template <typename Pose>
double CostOfStep(const typename History<Pose>::Step& step, const double* from, const double* to);

/// Adds the priors of an object to H and g and returns their cost; infinite where they fail.
double AddPriors(const Model& model, const Object& object, const Vector9d& chart, Quadratic* sum);
double CostOfPriors(const Model& model, const Object& object, const Vector9d& chart);

/// Cost of a quadratic at a chart; its gradient there.
inline double CostOf(const Quadratic& quadratic, const Vector9d& chart) {
  const Vector9d d = chart - quadratic.origin;
  return quadratic.g.dot(d) + 0.5 * d.dot(quadratic.H * d);
}
inline Vector9d GradientOf(const Quadratic& quadratic, const Vector9d& chart) {
  return quadratic.g + quadratic.H * (chart - quadratic.origin);
}

/// Derivatives by a pose of the camera's known height: J (k), residual; cost 0 where it is unknown.
template <typename Pose>
double LinearizeHeight(const Model& model,
                       const double* pose,
                       Eigen::Matrix<double, Pose::kTangentSize, 1>* jacobian);

}  // namespace dqslam::online
