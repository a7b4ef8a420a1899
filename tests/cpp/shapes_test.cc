// Cuboids and cylinders in a solve: told, or found by evidence.
#include "dqslam/estimation/shapes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <vector>

#include "dqslam/estimation/covariance.h"
#include "dqslam/estimation/solve.h"
#include "dqslam/geometry/body.h"
#include "scene.h"

namespace dqslam {
namespace {

// The objects of the scene stand upright: three cuboids, a can, and an ellipsoid.
constexpr Shape kTrueShapes[] = {
    Shape::kCuboid, Shape::kCuboid, Shape::kCuboid, Shape::kCylinder, Shape::kEllipsoid};

Vector9d TrueBody(int object, const Eigen::Vector3d& center) {
  const Eigen::Vector3d sides[] = {
      {0.3, 0.3, 0.3}, {0.2, 0.4, 0.3}, {0.35, 0.25, 0.15}, {0.25, 0.25, 0.3}, {0.3, 0.3, 0.3}};
  const Eigen::AngleAxisd yaw(0.3 + 0.2 * object, Eigen::Vector3d::UnitZ());
  return BodyParameters(center, sides[object], yaw.matrix());
}

// The boxes have a noise of `sigma` pixels, and the poses start at drifting odometry.
template <typename Pose>
Scene ShapesScene(double sigma) {
  Scene scene = MakeScene<Pose>();
  scene.truth.shapes.assign(std::begin(kTrueShapes), std::end(kTrueShapes));
  for (int object = 0; object < 4; ++object) {
    const Eigen::Vector3d center = scene.truth.landmarks.row(object).head<3>();
    scene.truth.landmarks.row(object) = TrueBody(object, center);
  }
  BoxTable& boxes = scene.graph.boxes;
  Random random(11);
  const Mount mount(scene.graph.camera);
  for (int row = 0; row < boxes.size(); ++row) {
    const int object = boxes.object[row];
    Eigen::Vector4d box = boxes.box.row(row);
    if (object < 4) {
      const Body<double> body =
          BodyModel{kTrueShapes[object]}.Unpack(scene.truth.landmarks.row(object).data());
      const CameraInWorld<double> camera =
          LocateCamera<Pose>(scene.truth.poses.row(boxes.pose[row]).data(), mount);
      EXPECT_TRUE(ProjectToBox(ToCamera(camera, body), scene.graph.camera, &box));
    }
    for (int edge = 0; edge < kBoxSize; ++edge) box[edge] += sigma * random.Normal();
    boxes.box.row(row) = box.transpose();
  }
  scene.graph.size_prior.log_sigma.setConstant(1);
  return scene;
}

template <typename Pose>
class ShapesOf : public testing::Test {};
using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(ShapesOf, PoseTypes);

TYPED_TEST(ShapesOf, ToldShapesHaveTheirSizes) {
  Scene scene = ShapesScene<TypeParam>(0.3);
  scene.graph.shapes = scene.truth.shapes;
  const Solution solution = Solve(scene.graph, SolveOptions());
  EXPECT_TRUE(solution.summary.converged) << ToString(solution.summary);
  ASSERT_EQ(solution.shapes, scene.truth.shapes);
  for (int object = 0; object < 4; ++object) {
    const auto sides_of = [&](const RowMatrix& landmarks) {
      Eigen::Vector3d sides = landmarks.row(object).segment<3>(3).array().exp();
      std::sort(sides.data(), sides.data() + 3);
      return sides;
    };
    EXPECT_LT((sides_of(solution.landmarks) - sides_of(scene.truth.landmarks)).norm(), 0.01);
    EXPECT_LT((solution.landmarks - scene.truth.landmarks).row(object).head<3>().norm(), 0.01);
  }
  EXPECT_LT((solution.poses - scene.truth.poses).leftCols(2).cwiseAbs().maxCoeff(), 0.02);
}

TYPED_TEST(ShapesOf, EvidenceFindsTheShapes) {
  Scene scene = ShapesScene<TypeParam>(0.3);
  scene.graph.shapes.assign(5, Shape::kAuto);
  std::vector<Shape> expected = scene.truth.shapes;
  // From one height, an upright can looks like an ellipsoid of other lengths.
  if (TypeParam::kModel == PoseModel::kSe2) expected[3] = Shape::kEllipsoid;
  EXPECT_EQ(Solve(scene.graph, SolveOptions()).shapes, expected);
}

TYPED_TEST(ShapesOf, CeresFindsTheSameMinimum) {
  Scene scene = ShapesScene<TypeParam>(0.3);
  scene.graph.shapes = scene.truth.shapes;
  const Solution native = Solve(scene.graph, SolveOptions());
  SolveOptions options;
  options.backend = Backend::kCeres;
  const Solution ceres =
      Solve(scene.graph, options, State{native.poses, native.landmarks, {}, native.shapes});
  EXPECT_NEAR(ceres.summary.final_cost, native.summary.final_cost, 1e-3);
}

TYPED_TEST(ShapesOf, EveryParameterHasACovariance) {
  Scene scene = ShapesScene<TypeParam>(0.3);
  const Covariance covariance = ComputeCovariance(scene.graph, SolveOptions(), scene.truth);
  EXPECT_TRUE(covariance.under_constrained.empty());
  for (int object = 0; object < 5; ++object) {
    const double center_variance = covariance.objects(object, 0);
    EXPECT_GT(center_variance, 1e-9);
    EXPECT_LT(center_variance, 1e-2);
  }
}

TEST(Shapes, EllipsoidsStayWhatTheyAreUnlessToldOtherwise) {
  const Scene scene = MakeScene<Se2>();
  EXPECT_TRUE(Solve(scene.graph, SolveOptions()).shapes.empty());
  Graph graph = scene.graph;
  graph.size_prior.log_sigma.setConstant(1);
  graph.shapes.assign(5, Shape::kAuto);
  EXPECT_TRUE(Solve(graph, SolveOptions()).shapes.empty());
  graph.shapes.resize(3);
  EXPECT_THROW(Solve(graph, SolveOptions()), std::invalid_argument);
}

}  // namespace
}  // namespace dqslam
