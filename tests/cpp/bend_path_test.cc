#include "dqslam/estimation/bend_path.h"

#include <gtest/gtest.h>

#include "random.h"

namespace dqslam {
namespace {

using Square = Eigen::Matrix3d;

RowMatrix StraightPath(int steps) {
  RowMatrix path = RowMatrix::Zero(steps + 1, 3);
  path.col(0) = Eigen::VectorXd::LinSpaced(steps + 1, 0, steps);
  return path;
}

// Odometry whose heading is exact: each step takes up an equal share of the translation.
TEST(BendPath, SharesATranslation) {
  const Square covariance = Eigen::Vector3d(0.1, 0.1, 1e-12).asDiagonal();
  RowMatrix path = StraightPath(4);
  BendPath<Se2>(std::vector<Square>(4, covariance), Eigen::Vector3d(4.4, 0.8, 0), &path);
  for (int pose = 0; pose <= 4; ++pose) {
    EXPECT_NEAR(path(pose, 0), 1.1 * pose, 1e-6);
    EXPECT_NEAR(path(pose, 1), 0.2 * pose, 1e-6);
    EXPECT_NEAR(path(pose, 2), 0, 1e-6);
  }
}

// A weak step takes up all of it.
TEST(BendPath, BendsAtTheWeakStep) {
  std::vector<Square> covariances(4, 1e-8 * Square::Identity());
  covariances[2] = Square::Identity();
  RowMatrix path = StraightPath(4);
  BendPath<Se2>(covariances, Eigen::Vector3d(2, 2, M_PI / 2), &path);
  EXPECT_LT((path.topRows(3) - StraightPath(4).topRows(3)).norm(), 1e-5);
  EXPECT_LT((path.row(3) - Eigen::RowVector3d(2, 1, M_PI / 2)).norm(), 1e-5);
}

// The end is reached exactly, and no small change of the steps that still ends there is likelier.
template <typename Pose>
void IsMostLikely() {
  constexpr int k = Pose::kTangentSize, kSteps = 6;
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Tangent = Eigen::Matrix<double, k, 1>;
  Random random(2);
  RowMatrix path(kSteps + 1, Pose::kSize);
  const Tangent zero = Tangent::Zero();
  Pose::FromTangent(zero.data(), path.row(0).data());
  std::vector<Eigen::Matrix<double, k, k>> covariances;
  for (int step = 0; step < kSteps; ++step) {
    const Tangent forward = Tangent::Unit(0) + random.template UniformVector<k>(-0.2, 0.2);
    Plus<Pose>(path.row(step).data(), forward.data(), path.row(step + 1).data());
    const Tangent sigma = random.template UniformVector<k>(0.05, 0.2);
    covariances.emplace_back(sigma.cwiseAbs2().asDiagonal());
  }
  const RowMatrix before = path;
  const auto cost = [&](const RowMatrix& poses) {
    double sum = 0;
    for (int step = 0; step < kSteps; ++step) {
      Storage measured, now;
      Pose::Between(before.row(step).data(), before.row(step + 1).data(), measured.data());
      Pose::Between(poses.row(step).data(), poses.row(step + 1).data(), now.data());
      Tangent error;
      Minus<Pose>(now.data(), measured.data(), error.data());
      sum += error.dot(covariances[step].ldlt().solve(error)) / 2;
    }
    return sum;
  };
  Storage target;
  const Tangent shift = random.template UniformVector<k>(-0.05, 0.05);
  Plus<Pose>(path.row(kSteps).data(), shift.data(), target.data());
  BendPath<Pose>(covariances, target, &path);
  EXPECT_EQ(path.row(0), before.row(0));
  EXPECT_EQ(path.row(kSteps), target.transpose());
  const double least = cost(path);
  EXPECT_GT(least, 0);
  for (int pose = 1; pose < kSteps; ++pose) {
    for (int axis = 0; axis < k; ++axis) {
      constexpr double kStep = 1e-3;
      RowMatrix up = path, down = path;
      const Tangent forth = kStep * Tangent::Unit(axis), back = -forth;
      Plus<Pose>(path.row(pose).data(), forth.data(), up.row(pose).data());
      Plus<Pose>(path.row(pose).data(), back.data(), down.row(pose).data());
      // The derivative is zero to the order of the shift; the curvature is that of two steps.
      const double slope = (cost(up) - cost(down)) / (2 * kStep);
      EXPECT_LT(std::abs(slope), 0.1) << "pose " << pose << " axis " << axis;
      EXPECT_GT(cost(up) + cost(down), 2 * least);
    }
  }
}

TEST(BendPath, IsMostLikelyInThePlane) {
  IsMostLikely<Se2>();
}
TEST(BendPath, IsMostLikelyInSpace) {
  IsMostLikely<Se3>();
}

TEST(MoveWith, KeepsTheViewFromThePose) {
  const Eigen::Vector3d before(1, 2, 0.3), after(-4, 5, 2.1);
  Surface<double> surface{Eigen::Vector3d(2, 3, 0.5), Eigen::Matrix3d::Identity()};
  surface.shape(0, 1) = surface.shape(1, 0) = 0.4;
  const Surface<double> moved = MoveWith<Se2>(before.data(), after.data(), surface);
  const auto view = [](const Eigen::Vector3d& pose, const Surface<double>& in_world) {
    const Rigid<double> robot = Se2::WorldFromRobot(pose.data());
    const Eigen::Matrix3d R = robot.rotation.transpose();
    return Surface<double>{R * (in_world.center - robot.translation),
                           R * in_world.shape * R.transpose()};
  };
  const Surface<double> one = view(before, surface), other = view(after, moved);
  EXPECT_LT((one.center - other.center).norm(), 1e-12);
  EXPECT_LT((one.shape - other.shape).norm(), 1e-12);
}

}  // namespace
}  // namespace dqslam
