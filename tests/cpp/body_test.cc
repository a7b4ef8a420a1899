// Cuboids and cylinders: their boxes beside sampled surfaces, their costs beside perturbation, and
// derivatives by hand beside AutoDiff.
#include "dqslam/geometry/body.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "cost_checks.h"
#include "dqslam/costs/body_priors.h"
#include "dqslam/costs/box.h"
#include "dqslam/costs/tangent.h"
#include "dqslam/geometry/body_derivatives.h"
#include "dqslam/geometry/outline.h"
#include "dqslam/solver/path_step.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 40;
constexpr Shape kShapes[] = {Shape::kCuboid, Shape::kCylinder};

Camera TestCamera(Random& random) {
  Camera camera;
  camera.fx = 500;
  camera.fy = 450;
  camera.cx = 320;
  camera.cy = 240;
  camera.width = 640;
  camera.height = 480;
  camera.robot_from_camera << random.UniformVector<3>(-0.5, 0.5), random.UnitQuaternion();
  return camera;
}

Vector9d RandomBody(Random& random, const Eigen::Vector3d& center) {
  return BodyParameters(center,
                        random.UniformVector<3>(0.2, 1),
                        Eigen::Quaterniond(random.UnitQuaternion().data()).matrix());
}

/// A body that a camera on a robot sees, and a box that nearly fits.
template <typename Pose>
struct Scene {
  Scene(Random& random, BodyModel model_)
      : camera(TestCamera(random)), mount(camera), model(model_) {
    pose = random.RandomPose<Pose>();
    const CameraInWorld<double> located = LocateCamera<Pose>(pose.data(), mount);
    const Eigen::Vector3d in_camera(
        random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(3, 8));
    body = RandomBody(random, located.camera_from_world.transpose() * in_camera + located.position);
    EXPECT_TRUE(ProjectToBox(InCamera(), camera, &observed));
    observed += random.UniformVector<4>(-20, 20);
  }
  Body<double> InCamera() const {
    return ToCamera(LocateCamera<Pose>(pose.data(), mount), model.Unpack(body.data()));
  }
  std::vector<Block> Blocks() const { return {PoseBlock<Pose>(pose), LandmarkBlock(body)}; }
  CostPointer Box(const EdgeFlags& one_sided = EdgeFlags::Constant(false)) const {
    return CostPointer(BoxCost<Pose, BodyModel>::Create(
        camera, mount, observed, Eigen::Matrix4d::Identity().eval(), one_sided, model));
  }
  CostPointer Tangent() const {
    return CostPointer(TangentCost<Pose, BodyModel>::Create(camera,
                                                            mount,
                                                            observed,
                                                            Eigen::Matrix4d::Identity().eval(),
                                                            4.0,
                                                            EdgeFlags::Constant(false).eval(),
                                                            model));
  }

  Camera camera;
  Mount mount;
  BodyModel model;
  Eigen::Matrix<double, Pose::kSize, 1> pose;
  Vector9d body;
  Eigen::Vector4d observed;
};

/// The box of 10^5 points of the surface: the faces of a cuboid, the rims of a cylinder, between
/// which the rest of its surface is straight.
Eigen::Vector4d SampledBox(const Body<double>& body, const Camera& camera) {
  std::vector<Eigen::Vector3d> points;
  if (body.shape == Shape::kCuboid) {
    constexpr int kSide = 129;
    for (int face = 0; face < 6; ++face) {
      for (int i = 0; i < kSide * kSide; ++i) {
        Eigen::Vector3d u;
        u[face % 3] = face < 3 ? 1 : -1;
        u[(face + 1) % 3] = 2.0 * (i % kSide) / (kSide - 1) - 1;
        u[(face + 2) % 3] = 2.0 * (i / kSide) / (kSide - 1) - 1;
        points.push_back(u);
      }
    }
  } else {
    for (int i = 0; i < 100000; ++i) {
      const double angle = 2 * M_PI * i / 50000;
      points.emplace_back(std::cos(angle), std::sin(angle), i < 50000 ? 1 : -1);
    }
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Eigen::Vector4d box(kInfinity, kInfinity, -kInfinity, -kInfinity);
  for (const Eigen::Vector3d& u : points) {
    const Eigen::Vector3d p = body.center + body.factor * u;
    const Eigen::Vector2d pixel(camera.fx * p.x() / p.z() + camera.cx,
                                camera.fy * p.y() / p.z() + camera.cy);
    box.head<2>() = box.head<2>().cwiseMin(pixel);
    box.tail<2>() = box.tail<2>().cwiseMax(pixel);
  }
  return box;
}

TEST(Body, ACubeStraightAheadByHand) {
  Camera camera;
  camera.fx = camera.fy = 100;
  camera.cx = camera.cy = 50;
  const Body<double> cube{Shape::kCuboid, 0, {0, 0, 5}, Eigen::Matrix3d::Identity()};
  Eigen::Vector4d box;
  ASSERT_TRUE(ProjectToBox(cube, camera, &box));  // The front face is at a depth of 4.
  EXPECT_LT((box - Eigen::Vector4d(25, 25, 75, 75)).norm(), 1e-12);
  // A can whose axis is the optical axis has the round front face of the same width.
  ASSERT_TRUE(
      ProjectToBox({Shape::kCylinder, 0, {0, 0, 5}, Eigen::Matrix3d::Identity()}, camera, &box));
  EXPECT_LT((box - Eigen::Vector4d(25, 25, 75, 75)).norm(), 1e-12);
}

TEST(Body, TheBoxIsThatOfTheSampledSurface) {
  Random random(1);
  for (const Shape shape : kShapes) {
    for (int trial = 0; trial < 10; ++trial) {
      const Scene<Se3> scene(random, {shape});
      Eigen::Vector4d box;
      ASSERT_TRUE(ProjectToBox(scene.InCamera(), scene.camera, &box));
      EXPECT_LT((box - SampledBox(scene.InCamera(), scene.camera)).cwiseAbs().maxCoeff(), 1e-5);
    }
  }
}

TEST(Body, RoundingIsExactAtZeroAndSmallElsewhere) {
  Eigen::Vector3d u;
  EXPECT_EQ(Width(Shape::kCuboid, 0.02, Eigen::Vector3d(3, 0, 0), &u), 3 / std::sqrt(1.0004));
  EXPECT_EQ(Width(Shape::kCuboid, 0.0, Eigen::Vector3d(3, -4, 5), &u), 12);
  EXPECT_EQ(u, Eigen::Vector3d(1, -1, 1));
  EXPECT_EQ(Width(Shape::kCylinder, 0.0, Eigen::Vector3d(3, -4, 5), &u), 10);
  EXPECT_LT((u - Eigen::Vector3d(0.6, -0.8, 1)).norm(), 1e-15);
  Random random(8);
  for (const Shape shape : kShapes) {
    const Scene<Se3> sharp(random, {shape});
    Body<double> rounded = sharp.InCamera();
    rounded.rounding = RoundedModel(shape).rounding;
    Eigen::Vector4d expected, box;
    ASSERT_TRUE(ProjectToBox(sharp.InCamera(), sharp.camera, &expected));
    ASSERT_TRUE(ProjectToBox(rounded, sharp.camera, &box));
    const double size = (expected.tail<2>() - expected.head<2>()).maxCoeff();
    EXPECT_LT((box - expected).cwiseAbs().maxCoeff(), 0.002 * size);
    EXPECT_GT((box - expected).cwiseAbs().maxCoeff(), 0);
  }
}

TEST(Body, TouchesTheTangentsOfItsBox) {
  Random random(2);
  for (const Shape shape : kShapes) {
    const Scene<Se3> scene(random, {shape});
    Eigen::Vector4d box, distances;
    ASSERT_TRUE(ProjectToBox(scene.InCamera(), scene.camera, &box));
    ASSERT_TRUE(TangentDistances(scene.InCamera(), scene.camera, box, 4, &distances));
    EXPECT_LT(distances.cwiseAbs().maxCoeff(), 1e-10);
    const auto points = TouchingPoints(scene.InCamera(), scene.camera, box);
    for (int edge = 0; edge < kBoxSize; ++edge) {
      EXPECT_NEAR(points(edge, edge % 2), box[edge], 1e-9);
    }
  }
}

TEST(Body, HasNoBoxUnlessAllOfItIsInFront) {
  for (const Shape shape : kShapes) {
    Eigen::Vector4d box;
    const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
    EXPECT_TRUE(ProjectToBox({shape, 0, {0, 0, 1.01}, unit}, Camera(), &box));
    EXPECT_FALSE(ProjectToBox({shape, 0, {0, 0, 0.99}, unit}, Camera(), &box));
    EXPECT_FALSE(ProjectToBox({shape, 0, {0, 0, -5}, unit}, Camera(), &box));
  }
}

template <typename Pose>
class BodyCosts : public testing::Test {};
using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(BodyCosts, PoseTypes);

TYPED_TEST(BodyCosts, JacobiansMatchPerturbation) {
  Random random(3);
  for (const Shape shape : kShapes) {
    for (int trial = 0; trial < 5; ++trial) {
      const Scene<TypeParam> scene(random, RoundedModel(shape));
      ExpectJacobiansMatchPerturbation(*scene.Box(), scene.Blocks());
      ExpectJacobiansMatchPerturbation(*scene.Tangent(), scene.Blocks());
    }
  }
}

TYPED_TEST(BodyCosts, AOneSidedEdgeCountsOnlyWhereTheBodyEndsInside) {
  Random random(4);
  const Scene<TypeParam> scene(random, RoundedModel(Shape::kCuboid));
  const EdgeFlags all = EdgeFlags::Constant(true);
  const Eigen::VectorXd both = ResidualOf(*scene.Box(), scene.Blocks());
  const Eigen::VectorXd one = ResidualOf(*scene.Box(all), scene.Blocks());
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const bool ends_inside = kBoxOutward[edge] * both[edge] < 0;
    EXPECT_EQ(one[edge], ends_inside ? both[edge] : 0);
  }
}

template <typename Pose>
void ExpectDerivatives(const Scene<Pose>& scene,
                       const BodyEdgeDerivatives& edges,
                       const ceres::CostFunction& cost) {
  Eigen::Matrix<double, kBoxSize, Pose::kTangentSize> by_pose;
  Eigen::Matrix<double, kBoxSize, kLandmarkSize> by_body;
  const Unpacked<BodyModel> body(scene.model, scene.body.data());
  const Station station = Station::At<Pose>(scene.pose.data(), scene.mount);
  ByPoseAndLandmark<Pose>(edges, station, scene.mount, body, &by_pose, &by_body);
  const Eigen::MatrixXd expected_pose = AutoDiffJacobian(cost, scene.Blocks(), 0);
  const Eigen::MatrixXd expected_body = AutoDiffJacobian(cost, scene.Blocks(), 1);
  EXPECT_LT((by_pose - expected_pose).cwiseAbs().maxCoeff(),
            1e-9 * expected_pose.cwiseAbs().maxCoeff());
  EXPECT_LT((by_body - expected_body).cwiseAbs().maxCoeff(),
            1e-9 * expected_body.cwiseAbs().maxCoeff());
}

TYPED_TEST(BodyCosts, DerivativesByHandAreThoseOfAutoDiff) {
  Random random(5);
  for (const Shape shape : kShapes) {
    for (int trial = 0; trial < kTrials; ++trial) {
      const Scene<TypeParam> scene(random, RoundedModel(shape));
      Eigen::Vector4d box, distances;
      BodyEdgeDerivatives edges;
      ASSERT_TRUE(DifferentiateBox(scene.InCamera(), scene.camera, &box, &edges));
      ExpectDerivatives(scene, edges, *scene.Box());
      ASSERT_TRUE(DifferentiateTangents(
          scene.InCamera(), scene.camera, scene.observed, 4, &distances, &edges));
      EXPECT_LT((distances - ResidualOf(*scene.Tangent(), scene.Blocks())).norm(), 1e-9);
      ExpectDerivatives(scene, edges, *scene.Tangent());
    }
  }
}

TYPED_TEST(BodyCosts, AStepBesideAPoseIsTheSameToFirstOrder) {
  Random random(6);
  const auto pose = random.RandomPose<TypeParam>();
  const Vector9d body = RandomBody(random, {1, 2, 3});
  for (const double size : {1e-3, 1e-4}) {
    const Eigen::Matrix<double, TypeParam::kTangentSize, 1> of_pose =
        size * random.RandomTangent<TypeParam>(1);
    const Vector9d of_body = size * random.UniformVector<9>(-1, 1);
    Eigen::Matrix<double, TypeParam::kSize, 1> after;
    Plus<TypeParam>(pose.data(), of_pose.data(), after.data());
    Vector9d beside, straight;
    ASSERT_TRUE(PlusBody(body.data(), of_body.data(), straight.data()));
    ASSERT_TRUE(PlusBodyBeside<TypeParam>(
        {pose.data(), of_pose.data(), after.data()}, body.data(), of_body.data(), beside.data()));
    EXPECT_LT((beside - straight).norm(), 50 * size * size);
  }
}

// On the ground z = -0.25, with half-lengths 0.2, 0.3, 0.9.
TEST(BodyPriors, ByHand) {
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  for (const Shape shape : kShapes) {
    const Vector9d level =
        BodyParameters({5, 6, 0.75}, {0.2, 0.3, 0.9}, Eigen::Matrix3d::Identity());
    const CostPointer support(BodySupportCost::Create(shape, up, 0.25, 0.1));
    EXPECT_NEAR(ResidualOf(*support, {LandmarkBlock(level)})[0], 1, 1e-12);

    const CostPointer upright(BodyUprightCost::Create(shape, up, 0.5));
    EXPECT_LT(ResidualOf(*upright, {LandmarkBlock(level)}).norm(), 1e-15);
    const Eigen::AngleAxisd tilt(1e-4, Eigen::Vector3d::UnitX());
    const Vector9d tilted = BodyParameters({0, 0, 0}, {0.2, 0.3, 0.9}, tilt.matrix());
    EXPECT_NEAR(ResidualOf(*upright, {LandmarkBlock(tilted)}).norm(), 1e-4 / 0.5, 1e-9);

    const CostPointer round(RoundCost::Create());
    EXPECT_NEAR(ResidualOf(*round, {LandmarkBlock(level)})[0], std::log(0.2 / 0.3) / 0.05, 1e-12);

    const CostPointer size(BodySizeCost::Create(std::log(0.3), 0.7));
    const Eigen::Vector3d expected(std::log(0.2 / 0.3) / 0.7, 0, std::log(3) / 0.7);
    EXPECT_LT((ResidualOf(*size, {LandmarkBlock(level)}) - expected).norm(), 1e-12);
  }
  // A can may lie on its side and roll; a box on its edge is not upright.
  const Vector9d rolled = BodyParameters({0, 0, 0},
                                         {0.2, 0.3, 0.9},
                                         (Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()) *
                                          Eigen::AngleAxisd(M_PI / 4, Eigen::Vector3d::UnitZ()))
                                             .toRotationMatrix());
  const auto tilt_of = [&](Shape shape) {
    const CostPointer cost(BodyUprightCost::Create(shape, up, 1.0));
    return ResidualOf(*cost, {LandmarkBlock(rolled)}).norm();
  };
  EXPECT_LT(tilt_of(Shape::kCylinder), 1e-12);
  EXPECT_NEAR(tilt_of(Shape::kCuboid), 0.5, 1e-12);
}

// A small tilt counts as if the body had to stand upright, and a large one as three sigmas.
TEST(BodyPriors, ABodyStandsUnlessItLeansFar) {
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  for (const Shape shape : kShapes) {
    const auto cost_of = [&](double tilt, double sigma) {
      const Vector9d body = BodyParameters(
          {0, 0, 0}, {0.2, 0.3, 0.9}, Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitX()).matrix());
      const CostPointer cost(BodyStandsCost::Create(BodyUprightCost{{}, shape, up, sigma}));
      return ResidualOf(*cost, {LandmarkBlock(body)}).norm();
    };
    EXPECT_NEAR(cost_of(1e-4, 0.02), 1e-4 / 0.02, 1e-7);
    const double off = 0.5 * std::sin(0.06) / 0.01;  // the product of two direction cosines
    EXPECT_NEAR(cost_of(0.03, 0.01), off / std::sqrt(1 + off * off / 9), 1e-12);
    EXPECT_NEAR(cost_of(M_PI / 4, 0.001), 3, 1e-4);
  }
}

TEST(BodyPriors, JacobiansMatchPerturbation) {
  Random random(7);
  const Eigen::Vector3d up = random.UnitQuaternion().head<3>().normalized();
  for (const Shape shape : kShapes) {
    const std::vector<Block> body = {LandmarkBlock(RandomBody(random, {1, -2, 0.5}))};
    ExpectJacobiansMatchPerturbation(*CostPointer(BodyUprightCost::Create(shape, up, 0.1)), body);
    ExpectJacobiansMatchPerturbation(
        *CostPointer(BodyStandsCost::Create(BodyUprightCost{{}, shape, up, 0.1})), body);
    ExpectJacobiansMatchPerturbation(*CostPointer(BodySupportCost::Create(shape, up, 0.5, 0.1)),
                                     body);
    ExpectJacobiansMatchPerturbation(*CostPointer(BodySizeCost::Create(-1.0, 0.7)), body);
  }
}

}  // namespace
}  // namespace dqslam
