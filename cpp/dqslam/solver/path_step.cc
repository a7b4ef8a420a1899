#include "dqslam/solver/path_step.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

#include "dqslam/geometry/body_derivatives.h"
#include "dqslam/geometry/manifolds.h"

namespace dqslam {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The tangent of an SE(2) or SE(3) pose as a motion in space, in the frame of the pose.
struct Twist {
  Vector3d translation, rotation;
};

template <typename Pose>
Twist InSpace(const double* tangent) {
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    return {Vector3d(tangent[0], tangent[1], 0), Vector3d(0, 0, tangent[2])};
  } else {
    return {Vector3d(tangent), Vector3d(tangent + 3)};
  }
}

template <typename Pose>
Eigen::Matrix<double, Pose::kTangentSize, 1> OfPose(const Twist& twist) {
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    return {twist.translation.x(), twist.translation.y(), twist.rotation.z()};
  } else {
    return (Eigen::Matrix<double, 6, 1>() << twist.translation, twist.rotation).finished();
  }
}

// The tangent of an ellipsoid S = L L^T that turns about its center, dS = [w] S - S [w].  It
// consists of the part of L^-1 dS L^-T below the diagonal and half of the diagonal, as in
// EllipsoidManifold::Minus.
Vector9d TurnTangent(const Matrix3d& L, const Vector3d& rotation) {
  Matrix3d turned;
  for (int column = 0; column < 3; ++column) turned.col(column) = rotation.cross(L.col(column));
  const Matrix3d X = L.triangularView<Eigen::Lower>().solve(turned);
  Matrix3d lower = (X + X.transpose()).triangularView<Eigen::Lower>();
  lower.diagonal() *= 0.5;
  const Matrix3d dL = L * lower;
  Vector9d tangent;
  tangent << 0, 0, 0, lower.diagonal(), dL(1, 0), dL(2, 0), dL(2, 1);
  return tangent;
}

// A viewer that moves, and what it carries with it.
struct Carrier {
  Rigid<double> before, after;
  Vector3d shift, turn;  // the tangent, in the world

  /// The change of a center, to first order.
  Vector3d ChangeOf(const Vector3d& center) const {
    return shift + turn.cross(center - before.translation);
  }
  Matrix3d Rotation() const { return after.rotation * before.rotation.transpose(); }
  Vector3d Move(const Vector3d& center) const {
    return after.translation + Rotation() * (center - before.translation);
  }
};

template <typename Pose>
Carrier CarrierOf(const MovedPose& viewer) {
  const Rigid<double> before = Pose::template WorldFromRobot<double>(viewer.before);
  const Twist twist = InSpace<Pose>(viewer.tangent);
  return {before,
          Pose::template WorldFromRobot<double>(viewer.after),
          before.rotation * twist.translation,
          before.rotation * twist.rotation};
}

}  // namespace

// Let z be the pose relative to the previous one.  T' = T (1 + tangent) of both poses gives, to
// first order, z' = z (1 + own tangent - Ad(z^-1) previous tangent).
template <typename Pose>
void PlusBehind(const MovedPose& previous,
                const double* pose,
                const double* tangent,
                double* moved) {
  double link[Pose::kSize], changed[Pose::kSize];
  Pose::Between(previous.before, pose, link);
  const Rigid<double> z = Pose::template WorldFromRobot<double>(link);
  const Twist base = InSpace<Pose>(previous.tangent), own = InSpace<Pose>(tangent);
  const Vector3d carried = base.translation + base.rotation.cross(z.translation);
  const auto change = OfPose<Pose>({own.translation - z.rotation.transpose() * carried,
                                    own.rotation - z.rotation.transpose() * base.rotation});
  Plus<Pose>(link, change.data(), changed);
  Pose::Compose(previous.after, changed, moved);
  Pose::Normalize(moved);
}

template <typename Pose>
bool PlusBeside(const MovedPose& viewer,
                const double* ellipsoid,
                const double* tangent,
                double* moved) {
  const Carrier carrier = CarrierOf<Pose>(viewer);
  Vector9d change = Eigen::Map<const Vector9d>(tangent) -
                    TurnTangent(Unpacked<EllipsoidModel>(ellipsoid).factor, carrier.turn);
  change.head<3>() -= carrier.ChangeOf(Vector3d(ellipsoid));
  Vector9d changed;
  if (!EllipsoidManifold().Plus(ellipsoid, change.data(), changed.data())) return false;

  const Matrix3d turned = carrier.Rotation() * Unpacked<EllipsoidModel>(changed.data()).factor;
  const Eigen::LLT<Matrix3d> cholesky(turned * turned.transpose());
  const Matrix3d L = cholesky.matrixL();
  Eigen::Map<Vector9d>(moved, kLandmarkSize) << carrier.Move(changed.head<3>()),
      L.diagonal().array().log(), L(1, 0), L(2, 0), L(2, 1);
  return cholesky.info() == Eigen::Success;
}

bool PlusBody(const double* body, const double* tangent, double* moved) {
  constexpr double kMostLogChange = 3;
  bool possible = true;
  for (int i = 0; i < kLandmarkSize; ++i) moved[i] = body[i] + tangent[i];
  for (int i = 3; i < 6; ++i) possible = possible && std::abs(tangent[i]) < kMostLogChange;
  return possible;
}

template <typename Pose>
bool PlusBodyBeside(const MovedPose& viewer,
                    const double* body,
                    const double* tangent,
                    double* moved) {
  const Carrier carrier = CarrierOf<Pose>(viewer);
  const Unpacked<BodyModel> unpacked(BodyModel(), body);  // as a frame, of any shape
  Vector9d change = Eigen::Map<const Vector9d>(tangent);
  change.head<3>() -= carrier.ChangeOf(Vector3d(body));
  change.tail<3>() -= unpacked.by_vector.inverse() * (unpacked.rotation.transpose() * carrier.turn);
  Vector9d changed;
  if (!PlusBody(body, change.data(), changed.data())) return false;
  const Eigen::AngleAxisd turned(carrier.Rotation() *
                                 Unpacked<BodyModel>(BodyModel(), changed.data()).rotation);
  Eigen::Map<Vector9d>(moved, kLandmarkSize) << carrier.Move(changed.head<3>()),
      changed.segment<3>(3), turned.angle() * turned.axis();
  return true;
}

template void PlusBehind<Se2>(const MovedPose&, const double*, const double*, double*);
template void PlusBehind<Se3>(const MovedPose&, const double*, const double*, double*);
template bool PlusBeside<Se2>(const MovedPose&, const double*, const double*, double*);
template bool PlusBeside<Se3>(const MovedPose&, const double*, const double*, double*);
template bool PlusBodyBeside<Se2>(const MovedPose&, const double*, const double*, double*);
template bool PlusBodyBeside<Se3>(const MovedPose&, const double*, const double*, double*);

}  // namespace dqslam
