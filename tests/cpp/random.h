// Random inputs for tests; the seed is an argument.
#pragma once

#include <Eigen/Core>
#include <random>

#include "dqslam/geometry/pose.h"

namespace dqslam {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double Uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double Normal() { return std::normal_distribution<double>()(engine_); }

  template <int kSize>
  Eigen::Matrix<double, kSize, 1> UniformVector(double low, double high) {
    return Eigen::Matrix<double, kSize, 1>::NullaryExpr([&] { return Uniform(low, high); });
  }

  /// Uniform over all rotations; x y z w.
  Eigen::Vector4d UnitQuaternion() {
    return Eigen::Vector4d::NullaryExpr([&] { return Normal(); }).normalized();
  }

  /// Full, with eigenvalues of at least `floor`.
  template <int kSize>
  Eigen::Matrix<double, kSize, kSize> Covariance(double floor = 0.3) {
    using Square = Eigen::Matrix<double, kSize, kSize>;
    const Square root = Square::NullaryExpr([&] { return Normal(); });
    return root * root.transpose() + floor * Square::Identity();
  }

  /// Positions within 3 m of the origin, any rotation.
  template <typename Pose>
  Eigen::Matrix<double, Pose::kSize, 1> RandomPose() {
    Eigen::Matrix<double, Pose::kSize, 1> pose;
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      pose << UniformVector<2>(-3, 3), Uniform(-M_PI, M_PI);
    } else {
      pose << UniformVector<3>(-3, 3), UnitQuaternion();
    }
    return pose;
  }

  /// A tangent whose rotation is of norm at most `max_angle`.
  template <typename Pose>
  Eigen::Matrix<double, Pose::kTangentSize, 1> RandomTangent(double max_angle) {
    Eigen::Matrix<double, Pose::kTangentSize, 1> tangent;
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      tangent << UniformVector<2>(-2, 2), Uniform(-max_angle, max_angle);
    } else {
      tangent << UniformVector<3>(-2, 2),
          Uniform(0, max_angle) * UnitQuaternion().head<3>().normalized();
    }
    return tangent;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace dqslam
