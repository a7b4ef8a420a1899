#include "dqslam/solver/path_step.h"

#include <gtest/gtest.h>

#include "dqslam/geometry/manifolds.h"
#include "random.h"

namespace dqslam {
namespace {

template <typename Pose>
using PoseVector = Eigen::Matrix<double, Pose::kSize, 1>;
template <typename Pose>
using Tangent = Eigen::Matrix<double, Pose::kTangentSize, 1>;

/// The rotation by `angle` about the vertical axis through the origin, as a pose.
template <typename Pose>
PoseVector<Pose> Turn(double angle) {
  PoseVector<Pose> turn;
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    turn << 0, 0, angle;
  } else {
    turn << 0, 0, 0, 0, 0, std::sin(angle / 2), std::cos(angle / 2);
  }
  return turn;
}

/// How a pose moves as the world turns, at the rate of one radian.
template <typename Pose>
Tangent<Pose> TurnTangent(const PoseVector<Pose>& pose) {
  const Rigid<double> rigid = Pose::template WorldFromRobot<double>(pose.data());
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d speed = rigid.rotation.transpose() * up.cross(rigid.translation);
  const Eigen::Vector3d rate = rigid.rotation.transpose() * up;
  if constexpr (Pose::kModel == PoseModel::kSe2) {
    return {speed.x(), speed.y(), rate.z()};
  } else {
    return (Tangent<Pose>() << speed, rate).finished();
  }
}

Vector9d Turned(const Vector9d& ellipsoid, double angle) {
  const Eigen::Matrix3d R = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  Surface<double> surface = EllipsoidModel::Unpack(ellipsoid.data());
  surface.center = R * surface.center;
  surface.shape = R * surface.shape * R.transpose();
  return EllipsoidFromSurface(surface);
}

/// By differences: independent of the algebra that is tested.
Vector9d TurnTangent(const Vector9d& ellipsoid) {
  constexpr double kStep = 1e-5;
  return (Turned(ellipsoid, kStep) - Turned(ellipsoid, -kStep)) / (2 * kStep);
}

template <typename Pose>
class PathStep : public testing::Test {
 protected:
  PathStep() {
    previous_ = random_.template RandomPose<Pose>();
    pose_ = random_.template RandomPose<Pose>();
    ellipsoid_ << random_.UniformVector<3>(-3, 3), random_.UniformVector<3>(-1, 0),
        random_.UniformVector<3>(-0.3, 0.3);
  }
  Random random_{3};
  PoseVector<Pose> previous_, pose_;
  Vector9d ellipsoid_;
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(PathStep, PoseTypes);

// By a radian, which tangents alone miss by half a meter.
TYPED_TEST(PathStep, ATurnOfEverythingIsExact) {
  constexpr double kAngle = 1;
  const PoseVector<TypeParam> turn = Turn<TypeParam>(kAngle);
  PoseVector<TypeParam> previous_after, expected, moved, straight;
  TypeParam::Compose(turn.data(), this->previous_.data(), previous_after.data());
  TypeParam::Compose(turn.data(), this->pose_.data(), expected.data());
  const Tangent<TypeParam> previous_step = kAngle * TurnTangent<TypeParam>(this->previous_);
  const Tangent<TypeParam> step = kAngle * TurnTangent<TypeParam>(this->pose_);
  const MovedPose previous{this->previous_.data(), previous_step.data(), previous_after.data()};
  PlusBehind<TypeParam>(previous, this->pose_.data(), step.data(), moved.data());
  EXPECT_LT((moved - expected).cwiseAbs().maxCoeff(), 1e-12);
  Plus<TypeParam>(this->pose_.data(), step.data(), straight.data());
  EXPECT_GT((straight - expected).cwiseAbs().maxCoeff(), 0.4);

  const Vector9d object_step = kAngle * TurnTangent(this->ellipsoid_);
  Vector9d object;
  ASSERT_TRUE(
      PlusBeside<TypeParam>(previous, this->ellipsoid_.data(), object_step.data(), object.data()));
  EXPECT_LT((object - Turned(this->ellipsoid_, kAngle)).cwiseAbs().maxCoeff(), 1e-8);
}

// What differs from Plus falls with the square of the step.
TYPED_TEST(PathStep, IsPlusToFirstOrder) {
  const Tangent<TypeParam> previous_step = this->random_.template RandomTangent<TypeParam>(1);
  const Tangent<TypeParam> step = this->random_.template RandomTangent<TypeParam>(1);
  const Vector9d object_step = this->random_.template UniformVector<9>(-1, 1);
  double of_pose[2], of_object[2];
  for (int half = 0; half < 2; ++half) {
    const double h = half == 0 ? 1e-3 : 5e-4;
    const Tangent<TypeParam> small_previous = h * previous_step, small = h * step;
    const Vector9d small_object = h * object_step;
    PoseVector<TypeParam> after, moved, straight;
    Plus<TypeParam>(this->previous_.data(), small_previous.data(), after.data());
    const MovedPose previous{this->previous_.data(), small_previous.data(), after.data()};
    PlusBehind<TypeParam>(previous, this->pose_.data(), small.data(), moved.data());
    Plus<TypeParam>(this->pose_.data(), small.data(), straight.data());
    of_pose[half] = (moved - straight).norm();
    Vector9d object, object_straight;
    ASSERT_TRUE(PlusBeside<TypeParam>(
        previous, this->ellipsoid_.data(), small_object.data(), object.data()));
    EllipsoidManifold().Plus(this->ellipsoid_.data(), small_object.data(), object_straight.data());
    of_object[half] = (object - object_straight).norm();
  }
  EXPECT_LT(of_pose[0], 1e-4);
  EXPECT_NEAR(of_pose[0] / of_pose[1], 4, 0.1);
  EXPECT_LT(of_object[0], 1e-4);
  EXPECT_NEAR(of_object[0] / of_object[1], 4, 0.1);
}

// Nothing before it moves: each goes as by itself.
TYPED_TEST(PathStep, BehindAPoseAtRestIsPlus) {
  const Tangent<TypeParam> rest = Tangent<TypeParam>::Zero();
  const Tangent<TypeParam> step = this->random_.template RandomTangent<TypeParam>(1);
  const MovedPose previous{this->previous_.data(), rest.data(), this->previous_.data()};
  PoseVector<TypeParam> moved, straight;
  PlusBehind<TypeParam>(previous, this->pose_.data(), step.data(), moved.data());
  Plus<TypeParam>(this->pose_.data(), step.data(), straight.data());
  EXPECT_LT((moved - straight).cwiseAbs().maxCoeff(), 1e-12);

  const Vector9d object_step = this->random_.template UniformVector<9>(-0.1, 0.1);
  Vector9d object, object_straight;
  ASSERT_TRUE(
      PlusBeside<TypeParam>(previous, this->ellipsoid_.data(), object_step.data(), object.data()));
  EllipsoidManifold().Plus(this->ellipsoid_.data(), object_step.data(), object_straight.data());
  EXPECT_LT((object - object_straight).cwiseAbs().maxCoeff(), 1e-12);
}

}  // namespace
}  // namespace dqslam
