// The pose models SE(2) and SE(3).  Both have the same static functions, so costs and manifolds are
// templates over the model.  blocks.h defines storage and tangent.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "dqslam/geometry/blocks.h"

namespace dqslam {

enum class PoseModel { kSe2, kSe3 };

/// A rigid transform target_from_source.
template <typename T>
struct Rigid {
  Matrix3<T> rotation;
  Vector3<T> translation;
};

/// Unit quaternion of a rotation vector [rad].
template <typename T>
Eigen::Quaternion<T> ExpRotation(const Vector3<T>& rotation_vector) {
  using std::cos, std::sin, std::sqrt;
  const T squared_angle = rotation_vector.squaredNorm();
  if (squared_angle < T(1e-16)) {  // sqrt has no derivative at zero
    const Vector3<T> half = rotation_vector * T(0.5);
    return Eigen::Quaternion<T>(T(1), half.x(), half.y(), half.z());
  }
  const T angle = sqrt(squared_angle);
  const Vector3<T> axis = rotation_vector * (sin(angle * T(0.5)) / angle);
  return Eigen::Quaternion<T>(cos(angle * T(0.5)), axis.x(), axis.y(), axis.z());
}

/// Rotation vector [rad] of a unit quaternion.  Its norm is at most pi.
template <typename T>
Vector3<T> LogRotation(const Eigen::Quaternion<T>& q) {
  using std::atan2, std::sqrt;
  const T sign = q.w() < T(0) ? T(-1) : T(1);
  const Vector3<T> v = sign * q.vec();
  const T w = sign * q.w();
  const T squared_sine = v.squaredNorm();
  if (squared_sine < T(1e-16)) return v * (T(2) / w);
  const T sine = sqrt(squared_sine);
  return v * (T(2) * atan2(sine, w) / sine);
}

struct Se2 {
  static constexpr PoseModel kModel = PoseModel::kSe2;
  static constexpr int kSize = 3;
  static constexpr int kTangentSize = 3;

  template <typename T>
  static Rigid<T> WorldFromRobot(const T* pose) {
    using std::cos, std::sin;
    const T c = cos(pose[2]), s = sin(pose[2]);
    Rigid<T> world_from_robot;
    world_from_robot.rotation << c, -s, T(0), s, c, T(0), T(0), T(0), T(1);
    world_from_robot.translation << pose[0], pose[1], T(0);
    return world_from_robot;
  }

  /// a_from_c = a_from_b o b_from_c
  template <typename T>
  static void Compose(const T* a_from_b, const T* b_from_c, T* a_from_c) {
    using std::cos, std::sin;
    const T c = cos(a_from_b[2]), s = sin(a_from_b[2]);
    const T x = a_from_b[0] + c * b_from_c[0] - s * b_from_c[1];
    const T y = a_from_b[1] + s * b_from_c[0] + c * b_from_c[1];
    a_from_c[0] = x;
    a_from_c[1] = y;
    a_from_c[2] = a_from_b[2] + b_from_c[2];
  }

  /// b_from_c = a_from_b^-1 o a_from_c
  template <typename T>
  static void Between(const T* a_from_b, const T* a_from_c, T* b_from_c) {
    using std::cos, std::sin;
    const T c = cos(a_from_b[2]), s = sin(a_from_b[2]);
    const T dx = a_from_c[0] - a_from_b[0], dy = a_from_c[1] - a_from_b[1];
    const T angle = a_from_c[2] - a_from_b[2];
    b_from_c[0] = c * dx + s * dy;
    b_from_c[1] = -s * dx + c * dy;
    b_from_c[2] = angle;
  }

  /// Tangent of a relative pose.  The angle is wrapped into [-pi, pi].
  template <typename T>
  static void ToTangent(const T* relative, T* tangent) {
    using std::floor;
    constexpr double kTwoPi = 2.0 * M_PI;
    tangent[0] = relative[0];
    tangent[1] = relative[1];
    tangent[2] = relative[2] - T(kTwoPi) * floor((relative[2] + T(M_PI)) / T(kTwoPi));
  }

  template <typename T>
  static void FromTangent(const T* tangent, T* relative) {
    for (int i = 0; i < 3; ++i) relative[i] = tangent[i];
  }

  /// Removes the rounding errors of repeated composition.  In SE(2) there is nothing to do.
  static void Normalize(double*) {}
};

struct Se3 {
  static constexpr PoseModel kModel = PoseModel::kSe3;
  static constexpr int kSize = 7;
  static constexpr int kTangentSize = 6;

  template <typename T>
  static Rigid<T> WorldFromRobot(const T* pose) {
    return {Rotation(pose).toRotationMatrix(), Translation(pose)};
  }

  /// a_from_c = a_from_b o b_from_c
  template <typename T>
  static void Compose(const T* a_from_b, const T* b_from_c, T* a_from_c) {
    const Eigen::Quaternion<T> q = Rotation(a_from_b) * Rotation(b_from_c);
    const Vector3<T> t = Translation(a_from_b) + Rotation(a_from_b) * Translation(b_from_c);
    Write(t, q, a_from_c);
  }

  /// b_from_c = a_from_b^-1 o a_from_c
  template <typename T>
  static void Between(const T* a_from_b, const T* a_from_c, T* b_from_c) {
    const Eigen::Quaternion<T> b_from_a = Rotation(a_from_b).conjugate();
    const Vector3<T> t = b_from_a * (Translation(a_from_c) - Translation(a_from_b));
    Write(t, b_from_a * Rotation(a_from_c), b_from_c);
  }

  /// Tangent of a relative pose: translation and rotation vector.
  template <typename T>
  static void ToTangent(const T* relative, T* tangent) {
    Eigen::Map<Eigen::Matrix<T, 6, 1>> result(tangent);
    result << Translation(relative), LogRotation(Rotation(relative));
  }

  template <typename T>
  static void FromTangent(const T* tangent, T* relative) {
    Write<T>(Translation(tangent), ExpRotation<T>(Translation(tangent + 3)), relative);
  }

  /// Removes the rounding errors of repeated composition from the quaternion.
  static void Normalize(double* pose) { Eigen::Map<Eigen::Vector4d>(pose + 3).normalize(); }

 private:
  template <typename T>
  static Vector3<T> Translation(const T* pose) {
    return Eigen::Map<const Vector3<T>>(pose);
  }
  template <typename T>
  static Eigen::Quaternion<T> Rotation(const T* pose) {
    return Eigen::Quaternion<T>(pose[6], pose[3], pose[4], pose[5]);
  }
  template <typename T>
  static void Write(const Vector3<T>& t, const Eigen::Quaternion<T>& q, T* pose) {
    Eigen::Map<Eigen::Matrix<T, 7, 1>> result(pose);
    result << t, q.coeffs();
  }
};

/// pose (+) tangent, in the frame of the pose.
template <typename Pose, typename T>
void Plus(const T* pose, const T* tangent, T* result) {
  T relative[Pose::kSize];
  Pose::FromTangent(tangent, relative);
  Pose::Compose(pose, relative, result);
}

/// pose (-) origin, the tangent with origin (+) tangent = pose.
template <typename Pose, typename T>
void Minus(const T* pose, const T* origin, T* tangent) {
  T relative[Pose::kSize];
  Pose::Between(origin, pose, relative);
  Pose::ToTangent(relative, tangent);
}

/// The matrix A with `a_from_b o Exp(x) = Exp(A x) o a_from_b`.  It converts a small motion in the
/// frame of b to the same motion in the frame of a.
template <typename Pose>
Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize> Adjoint(const double* a_from_b) {
  const Rigid<double> rigid = Pose::template WorldFromRobot<double>(a_from_b);
  const Vector3<double>& t = rigid.translation;
  Matrix3<double> cross;  // cross * v = t x v
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  Eigen::Matrix<double, 6, 6> full;
  full << rigid.rotation, cross * rigid.rotation, Matrix3<double>::Zero(), rigid.rotation;
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    const std::array<int, 3> planar = {0, 1, 5};
    return full(planar, planar);
  } else {
    return full;
  }
}

}  // namespace dqslam
