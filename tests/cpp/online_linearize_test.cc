#include <gtest/gtest.h>

#include <random>

#include "dqslam/costs/box.h"
#include "dqslam/costs/measurements.h"
#include "dqslam/costs/size_prior.h"
#include "dqslam/online/linearize.h"

namespace dqslam::online {
namespace {

constexpr double kStep = 1e-6;

Camera MakeCamera() {
  Camera camera;
  camera.fx = 500;
  camera.fy = 510;
  camera.cx = 320;
  camera.cy = 240;
  camera.width = 640;
  camera.height = 480;
  // A little turned and off the middle of the robot, looking to the left.
  camera.robot_from_camera << 0.1, 0.2, 1.0, -std::sqrt(0.5), 0, 0, std::sqrt(0.5);
  return camera;
}

template <typename Pose>
typename History<Pose>::Storage MakePose() {
  typename History<Pose>::Storage pose;
  const Eigen::Matrix<double, Pose::kTangentSize, 1> tangent =
      Eigen::Matrix<double, Pose::kTangentSize, 1>::LinSpaced(0.1, 0.3);
  Pose::FromTangent(tangent.data(), pose.data());
  return pose;
}

Vector9d MakeObject(double distance) {
  return CenterShapeFromEllipsoid(EllipsoidFromAxes(
      {-1, distance, 1.6}, {0.6, 0.4, 0.3}, Eigen::Vector4d(0.1, 0.2, 0.3, 0.9).normalized()));
}

// J^T r against central differences of |r|^2 / 2, for residuals of many directions.
template <typename Pose>
void ExpectDerivatives(double distance, bool is_box, bool truncated) {
  const Model model(MakeCamera(), ScenePriors(), 0);
  const auto pose = MakePose<Pose>();
  const Vector9d center_shape = MakeObject(distance);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int draw = 0; draw < 6; ++draw) {
    Observation observation{};
    observation.kind = is_box ? Observation::kBox : MeasurementKind("position");
    observation.value << 250, 200, 380, 290;
    if (!is_box) observation.value << 1, 2, 3, 0;
    for (int i = 0; i < 4; ++i) observation.value[i] += (is_box ? 20 : 1) * normal(random);
    if (!is_box) observation.value[3] = 0;
    const Eigen::Matrix4d W = Eigen::Matrix4d::NullaryExpr([&] { return normal(random); });
    observation.SetSqrtInformation(Eigen::Matrix4d::Identity() + 0.3 * W);
    if (truncated) observation.truncated << true, false, true, false;
    const auto station = [&](const typename History<Pose>::Storage& at) {
      return Station::At<Pose>(at.data(), model.mount);
    };
    LinearizedObservation<Pose> linear;
    Linearize<Pose>(model, station(pose), observation, center_shape, EdgeResidual::kBox, &linear);
    double unused;
    EXPECT_NEAR(linear.cost,
                CostOfObservation<Pose>(
                    model, station(pose), observation, center_shape, linear.depth, &unused),
                1e-9 * (1 + linear.cost));
    EXPECT_EQ(linear.depth > 0, is_box && distance < 2);
    const Eigen::VectorXd by_pose = linear.by_pose.transpose() * linear.residual;
    for (int i = 0; i < Pose::kTangentSize; ++i) {
      double cost[2];
      for (int side = 0; side < 2; ++side) {
        Eigen::Matrix<double, Pose::kTangentSize, 1> tangent;
        tangent.setZero();
        tangent[i] = side == 0 ? -kStep : kStep;
        typename History<Pose>::Storage moved;
        Plus<Pose>(pose.data(), tangent.data(), moved.data());
        cost[side] = CostOfObservation<Pose>(
            model, station(moved), observation, center_shape, linear.depth, &unused);
      }
      EXPECT_NEAR(by_pose[i], (cost[1] - cost[0]) / (2 * kStep), 1e-4 * (1 + by_pose.norm()));
    }
    const Vector9d by_object = linear.by_object.transpose() * linear.residual;
    for (int i = 0; i < 9; ++i) {
      const Vector9d d = kStep * Vector9d::Unit(i);
      const double ahead = CostOfObservation<Pose>(
          model, station(pose), observation, center_shape + d, linear.depth, &unused);
      const double behind = CostOfObservation<Pose>(
          model, station(pose), observation, center_shape - d, linear.depth, &unused);
      EXPECT_NEAR(by_object[i], (ahead - behind) / (2 * kStep), 1e-4 * (1 + by_object.norm()));
    }
  }
}

TEST(Linearize, BoxesInThePlane) {
  ExpectDerivatives<Se2>(6, true, false);
}
TEST(Linearize, BoxesInSpace) {
  ExpectDerivatives<Se3>(6, true, false);
}
TEST(Linearize, TruncatedBoxes) {
  ExpectDerivatives<Se3>(6, true, true);
}
TEST(Linearize, TangentsOfObjectsBehindInThePlane) {
  ExpectDerivatives<Se2>(-3, true, false);
}
TEST(Linearize, TangentsOfObjectsBehindInSpace) {
  ExpectDerivatives<Se3>(-3, true, false);
}
TEST(Linearize, PositionsInThePlane) {
  ExpectDerivatives<Se2>(6, false, false);
}
TEST(Linearize, PositionsInSpace) {
  ExpectDerivatives<Se3>(6, false, false);
}

// The residual is that of the cost which the batch minimizes.
TEST(Linearize, IsTheBoxCost) {
  const Camera camera = MakeCamera();
  const Model model(camera, ScenePriors(), 0);
  const auto pose = MakePose<Se3>();
  const Vector9d center_shape = MakeObject(6);
  Vector9d ellipsoid;
  EllipsoidFromCenterShape(center_shape.data(), ellipsoid.data());
  Observation observation{};
  observation.value << 250, 200, 380, 290;
  observation.SetSqrtInformation(Eigen::Vector4d(1, 2, 3, 4).asDiagonal());
  observation.truncated.setConstant(false);
  const BoxCost<Se3, EllipsoidModel> cost{{},
                                          camera,
                                          Mount(camera),
                                          observation.value,
                                          observation.SqrtInformation(),
                                          observation.truncated};
  Eigen::Vector4d expected;
  ASSERT_TRUE(cost(pose.data(), ellipsoid.data(), expected.data()));
  LinearizedObservation<Se3> linear;
  const Station station = Station::At<Se3>(pose.data(), model.mount);
  Linearize<Se3>(model, station, observation, center_shape, EdgeResidual::kBox, &linear);
  EXPECT_LT((linear.residual - expected).norm(), 1e-9);
}

// An error of zero is no sign that an edge does not count: each pulls at the object as soon as it
// moves.
TEST(Linearize, EdgesThatFitExactlyHaveDerivatives) {
  const Model model(MakeCamera(), ScenePriors(), 0);
  const auto pose = MakePose<Se3>();
  const Vector9d center_shape = MakeObject(6);
  const Station station = Station::At<Se3>(pose.data(), model.mount);
  Observation observation{};
  observation.SetSqrtInformation(Eigen::Matrix4d::Identity());
  observation.truncated << true, false, false, false;
  ASSERT_TRUE(ProjectToBox(
      ToCamera(station.camera, SurfaceOf(center_shape)), model.camera, &observation.value));
  LinearizedObservation<Se3> linear;
  Linearize(model, station, observation, center_shape, EdgeResidual::kBox, &linear);
  EXPECT_EQ(linear.residual.norm(), 0);
  EXPECT_GT(linear.by_object.rowwise().norm().minCoeff(), 10);
  EXPECT_GT(linear.by_pose.rowwise().norm().minCoeff(), 10);
}

// Half of c^2 log(1 + s / c^2), and the gradient that goes with it.
TEST(Linearize, WeighsByTheCauchyLoss) {
  const Model plain(MakeCamera(), ScenePriors(), 0), robust(MakeCamera(), ScenePriors(), 2);
  const auto pose = MakePose<Se2>();
  const Vector9d center_shape = MakeObject(6);
  Observation observation{};
  observation.value << 250, 200, 380, 290;
  observation.SetSqrtInformation(Eigen::Matrix4d::Identity());
  observation.truncated.setConstant(false);
  LinearizedObservation<Se2> all, weighed;
  const Station station = Station::At<Se2>(pose.data(), plain.mount);
  Linearize<Se2>(plain, station, observation, center_shape, EdgeResidual::kBox, &all);
  Linearize<Se2>(robust, station, observation, center_shape, EdgeResidual::kBox, &weighed);
  const double s = all.residual.squaredNorm();
  EXPECT_NEAR(weighed.cost, 0.5 * 4 * std::log1p(s / 4), 1e-9);
  const Vector9d expected = all.by_object.transpose() * all.residual / (1 + s / 4);
  EXPECT_LT((weighed.by_object.transpose() * weighed.residual - expected).norm(),
            1e-9 * expected.norm());
}

TEST(CenterShape, ThereAndBack) {
  Vector9d ellipsoid;
  const Vector9d center_shape = MakeObject(6);
  EllipsoidFromCenterShape(center_shape.data(), ellipsoid.data());
  EXPECT_LT((CenterShapeFromEllipsoid(ellipsoid) - center_shape).norm(), 1e-12);
}

TEST(CenterShape, MovesInAStraightLineWhileItCan) {
  const Vector9d center_shape = MakeObject(6);
  Vector9d moved;
  const Vector9d small = 1e-3 * Vector9d::Ones();
  ASSERT_TRUE(RetractCenterShape(center_shape, small, &moved));
  EXPECT_LT((moved - center_shape - small).norm(), 1e-9);
  // Far beyond the cone of ellipsoids it bends, and stays one.
  Vector9d large = Vector9d::Zero();
  large[3] = -5;
  ASSERT_TRUE(RetractCenterShape(center_shape, large, &moved));
  EXPECT_GT(ShapeOf(moved.data()).determinant(), 0);
}

// The prior on size, by hand: a sphere of twice the mean radius is log(2) / sigma off, three times.
TEST(Priors, OfASphere) {
  const Model model(MakeCamera(), ScenePriors(), 0);
  Object object;
  object.size = {std::log(0.3), 0.5};
  const Vector9d center_shape = CenterShapeFromEllipsoid(Sphere({1, 2, 3}, 0.6));
  const double expected = 0.5 * 3 * std::pow(std::log(2) / 0.5, 2);
  EXPECT_NEAR(CostOfPriors(model, object, center_shape), expected, 1e-9);
  GaussianPrior sum;
  EXPECT_NEAR(AddPriors(model, object, center_shape, &sum), expected, 1e-9);
  for (int i = 0; i < 9; ++i) {
    const Vector9d d = kStep * Vector9d::Unit(i);
    const double slope = (CostOfPriors(model, object, center_shape + d) -
                          CostOfPriors(model, object, center_shape - d)) /
                         (2 * kStep);
    EXPECT_NEAR(sum.g[i], slope, 1e-5);
  }
}

// A step measured in one unit of sigma too far costs one half.
TEST(Steps, CostByHand) {
  History<Se2>::Step step;
  step.relative << 1, 0, 0;
  step.sqrt_information = Eigen::Vector3d(10, 10, 10).asDiagonal();
  const Eigen::Vector3d from(0, 0, M_PI / 2), to(0, 1.1, M_PI / 2);
  EXPECT_NEAR(CostOfStep<Se2>(step, from.data(), to.data()), 0.5, 1e-9);
  const LinearizedStep<Se2> linear = LinearizeStep<Se2>(step, from.data(), to.data());
  EXPECT_NEAR(linear.residual.squaredNorm(), 1, 1e-9);
  // Both tangents are in the frames of their poses: pushing both ahead changes nothing.
  EXPECT_LT((linear.by_from.col(0) + linear.by_to.col(0)).norm(), 1e-9);
}

}  // namespace
}  // namespace dqslam::online
