#include "dqslam/geometry/batch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/objects_in_camera.h"
#include "scene.h"

namespace dqslam {
namespace {

template <typename Pose>
class Rows : public testing::Test {
 protected:
  static constexpr int kRows = 5;

  RowMatrix RandomPoses() {
    RowMatrix poses(kRows, Pose::kSize);
    for (int row = 0; row < kRows; ++row) poses.row(row) = random_.RandomPose<Pose>();
    return poses;
  }

  Random random_{1};
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(Rows, PoseTypes);

TYPED_TEST(Rows, DoWhatThePoseModelDoesRowByRow) {
  const RowMatrix a = this->RandomPoses(), b = this->RandomPoses();
  const RowMatrix composed = ComposeRows(TypeParam::kModel, a, b);
  const RowMatrix between = BetweenRows(TypeParam::kModel, a, b);
  const RowMatrix minus = MinusRows(TypeParam::kModel, b, a);
  const RowMatrix plus = PlusRows(TypeParam::kModel, a, minus);
  const RowMatrix inverse = InverseRows(TypeParam::kModel, a);
  const RowMatrix adjoint = AdjointRows(TypeParam::kModel, a);
  constexpr int k = TypeParam::kTangentSize;
  ASSERT_EQ(composed.rows(), this->kRows);
  for (int row = 0; row < this->kRows; ++row) {
    Eigen::Matrix<double, TypeParam::kSize, 1> pose;
    Eigen::Matrix<double, TypeParam::kTangentSize, 1> tangent;
    TypeParam::Compose(a.row(row).data(), b.row(row).data(), pose.data());
    TypeParam::Normalize(pose.data());
    EXPECT_EQ(composed.row(row), pose.transpose());
    TypeParam::Between(a.row(row).data(), b.row(row).data(), pose.data());
    TypeParam::Normalize(pose.data());
    EXPECT_EQ(between.row(row), pose.transpose());
    Minus<TypeParam>(b.row(row).data(), a.row(row).data(), tangent.data());
    EXPECT_EQ(minus.row(row), tangent.transpose());
    Plus<TypeParam>(a.row(row).data(), tangent.data(), pose.data());
    TypeParam::Normalize(pose.data());
    EXPECT_EQ(plus.row(row), pose.transpose());
    TypeParam::Compose(a.row(row).data(), inverse.row(row).data(), pose.data());
    TypeParam::ToTangent(pose.data(), tangent.data());
    EXPECT_LT(tangent.norm(), 1e-14);
    EXPECT_EQ(adjoint.middleRows(k * row, k), Adjoint<TypeParam>(a.row(row).data()));
  }
}

TYPED_TEST(Rows, DeadReckoningInvertsBetween) {
  const RowMatrix poses = this->RandomPoses();
  const int steps = this->kRows - 1;
  const RowMatrix relative =
      BetweenRows(TypeParam::kModel, poses.topRows(steps), poses.bottomRows(steps));
  const RowMatrix again = DeadReckonRows(TypeParam::kModel, poses.row(0).transpose(), relative);
  ASSERT_EQ(again.rows(), this->kRows);
  EXPECT_LT(MinusRows(TypeParam::kModel, again, poses).cwiseAbs().maxCoeff(), 1e-12);
}

TYPED_TEST(Rows, CameraPosesAreThoseOfTheOracle) {
  const Camera camera = SceneCamera();
  const RowMatrix poses = this->RandomPoses();
  const RowMatrix world_from_camera = WorldFromCameraRows(TypeParam::kModel, camera, poses);
  for (int row = 0; row < this->kRows; ++row) {
    const oracle::Viewpoint view = ViewFrom<TypeParam>(poses.row(row).data(), camera);
    const Eigen::Matrix<double, 7, 1> found = world_from_camera.row(row);
    EXPECT_LT((found.head<3>() - view.position).norm(), 1e-13);
    EXPECT_LT((oracle::RotationMatrix(found.tail<4>()) - view.rotation).norm(), 1e-13);
    EXPECT_NEAR(found.tail<4>().norm(), 1, 1e-14);
  }
}

TYPED_TEST(Rows, BoxesAreThoseOfTheSampledSurface) {
  const Scene scene = MakeScene<TypeParam>();
  const BoxTable& boxes = scene.graph.boxes;
  ASSERT_GT(boxes.size(), 50);
  RowMatrix poses(boxes.size(), TypeParam::kSize), ellipsoids(boxes.size(), kLandmarkSize);
  for (int row = 0; row < boxes.size(); ++row) {
    poses.row(row) = scene.truth.poses.row(boxes.pose[row]);
    ellipsoids.row(row) = scene.truth.landmarks.row(boxes.object[row]);
  }
  const auto [found, in_front] =
      ProjectToBoxesRows(TypeParam::kModel, scene.graph.camera, poses, ellipsoids);
  EXPECT_TRUE(in_front.all());
  EXPECT_LT((found - boxes.box).cwiseAbs().maxCoeff(), 1e-6);
}

TYPED_TEST(Rows, JacobiansOfBoxesAreWhatPerturbationsShow) {
  constexpr int k = TypeParam::kTangentSize, kParameters = k + kLandmarkSize;
  constexpr double kStep = 1e-6;
  const Scene scene = MakeScene<TypeParam>();
  const BoxTable& of = scene.graph.boxes;
  const RowMatrix poses = scene.truth.poses(of.pose, Eigen::all);
  const RowMatrix ellipsoids = scene.truth.landmarks(of.object, Eigen::all);
  const Camera& camera = scene.graph.camera;
  const auto [boxes, in_front, jacobians] =
      DifferentiateBoxesRows(TypeParam::kModel, camera, poses, ellipsoids);
  EXPECT_EQ(boxes, ProjectToBoxesRows(TypeParam::kModel, camera, poses, ellipsoids).first);
  ASSERT_TRUE(in_front.all());
  for (int column = 0; column < kParameters; ++column) {
    const auto moved = [&](double step) {
      RowMatrix change = RowMatrix::Zero(of.size(), kParameters);
      change.col(column).setConstant(step);
      return ProjectToBoxesRows(TypeParam::kModel,
                                camera,
                                PlusRows(TypeParam::kModel, poses, change.leftCols(k)),
                                ellipsoids + change.rightCols(kLandmarkSize))
          .first;
    };
    const RowMatrix expected = (moved(kStep) - moved(-kStep)) / (2 * kStep);
    const RowMatrix found =
        jacobians.col(column).template reshaped<Eigen::RowMajor>(of.size(), Eigen::fix<kBoxSize>);
    EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-3) << "column " << column;
  }
}

TEST(Shapes, AreThoseOfBothModels) {
  RowMatrix ellipsoids(2, kLandmarkSize);
  ellipsoids << 1, 2, 3, std::log(2.0), std::log(3.0), std::log(4.0), 0, 0, 0,  //
      4, 5, 6, 0, 0, 0, 0.5, 0, 0;
  RowMatrix expected(6, 3);
  expected << 4, 0, 0, 0, 9, 0, 0, 0, 16, 1, 0.5, 0, 0.5, 1.25, 0, 0, 0, 1;
  EXPECT_LT((EllipsoidShapeRows(ellipsoids) - expected).norm(), 1e-14);
  RowMatrix quadrics(2, kLandmarkSize);
  for (const int row : {0, 1}) {
    quadrics.row(row) = DualQuadricFromEllipsoid(ellipsoids.row(row).transpose());
  }
  EXPECT_LT((DualQuadricShapeRows(quadrics) - expected).norm(), 1e-13);
  quadrics.row(1) << 1, 0, 0, 0, 1, 0, 0, 1, 0;  // Q* = I: no ellipsoid, S = -I
  EXPECT_EQ(DualQuadricShapeRows(quadrics).bottomRows<3>(), -Eigen::Matrix3d::Identity());
}

TEST(ProjectToBoxesRows, IsNanWhereTheObjectIsNotStrictlyInFront) {
  RowMatrix poses = RowMatrix::Zero(3, 3), ellipsoids(3, kLandmarkSize);
  ellipsoids.row(0) = Sphere({0, 5, 0}, 0.5);   // the camera looks left: in front
  ellipsoids.row(1) = Sphere({0, -5, 0}, 0.5);  // behind
  ellipsoids.row(2) = Sphere({0, 0, 0}, 0.5);   // around
  const auto [boxes, in_front] =
      ProjectToBoxesRows(PoseModel::kSe2, SceneCamera(), poses, ellipsoids);
  EXPECT_TRUE(in_front[0] && boxes.row(0).allFinite());
  for (const int row : {1, 2}) {
    EXPECT_FALSE(in_front[row]);
    EXPECT_TRUE(boxes.row(row).array().isNaN().all());
  }
  const auto [same, also_in_front, jacobians] =
      DifferentiateBoxesRows(PoseModel::kSe2, SceneCamera(), poses, ellipsoids);
  EXPECT_TRUE((also_in_front == in_front).all());
  EXPECT_EQ(same.row(0), boxes.row(0));
  EXPECT_TRUE(jacobians.topRows<4>().allFinite());
  EXPECT_TRUE(jacobians.bottomRows<8>().array().isNaN().all());
  const RowMatrix outlines =
      ProjectToOutlinesRows(PoseModel::kSe2, SceneCamera(), poses, ellipsoids, 5);
  EXPECT_TRUE(outlines.topRows<5>().allFinite());
  EXPECT_TRUE(outlines.bottomRows<10>().array().isNaN().all());
}

void ExpectShapeError(const std::string& message, const std::function<void()>& call) {
  try {
    call();
    ADD_FAILURE() << "no exception: " << message;
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr(message));
  }
}

// Files give quaternions to nine digits: over a long path the norms would drift apart.
// The camera looks along y, from 4 m.  A cube's box is that of its front; a can's sides are the
// tangents of its rim, and its lids' nearest points are as far as the cube's front.
TEST(ProjectToBoxesRows, HasTheBoxesOfCuboidsAndCylinders) {
  const RowMatrix poses = RowMatrix::Zero(3, 3);
  RowMatrix centers(3, 3), factors(3, 9);
  centers.rowwise() = Eigen::RowVector3d(0.1, 4.05, 0.4);
  centers(2, 1) = 0.3;  // around the camera
  for (int row = 0; row < 3; ++row) factors.row(row) << 0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5;
  const BodyTable bodies{{Shape::kCuboid, Shape::kCylinder, Shape::kCuboid}, centers, factors};
  const auto [boxes, in_front] = ProjectToBoxesRows(PoseModel::kSe2, SceneCamera(), poses, bodies);
  const double front = 400 * 0.5 / 3.5, rim = 400 * 0.5 / std::sqrt(16 - 0.25);
  const double half_width[] = {front, rim};
  for (const int row : {0, 1}) {
    EXPECT_TRUE(in_front[row]);
    const double u = half_width[row];
    const Eigen::RowVector4d expected(319.5 - u, 239.5 - front, 319.5 + u, 239.5 + front);
    EXPECT_LT((boxes.row(row) - expected).cwiseAbs().maxCoeff(), 0.002 * front) << row;
  }
  EXPECT_FALSE(in_front[2]);
  EXPECT_TRUE(boxes.row(2).array().isNaN().all());
}

TEST(DeadReckonRows, KeepsQuaternionsUnit) {
  RowMatrix relative(5000, 7);
  Eigen::Matrix<double, 1, 7> step;
  step << 0.1, 0, 0, 0, 0, 0.1 * (1 + 1e-9), std::sqrt(0.99);
  relative.rowwise() = step;
  Eigen::VectorXd first = Eigen::VectorXd::Zero(7);
  first[6] = 1;
  const RowMatrix path = DeadReckonRows(PoseModel::kSe3, first, relative);
  EXPECT_LT((path.rightCols<4>().rowwise().norm().array() - 1).abs().maxCoeff(), 1e-14);
}

TEST(RowShapes, NameTheTableOfTheWrongShape) {
  const RowMatrix two = RowMatrix::Zero(2, 3), three = RowMatrix::Zero(3, 3);
  const RowMatrix wide = RowMatrix::Zero(2, 7);
  const Camera camera = SceneCamera();
  const PoseModel se2 = PoseModel::kSe2, se3 = PoseModel::kSe3;
  ExpectShapeError("a_from_b has shape (2, 7), expected (2, 3)",
                   [&] { ComposeRows(se2, wide, two); });
  ExpectShapeError("b_from_c has shape (3, 3), expected (2, 3)",
                   [&] { ComposeRows(se2, two, three); });
  ExpectShapeError("a_from_c has shape (3, 3)", [&] { BetweenRows(se2, two, three); });
  ExpectShapeError("tangents has shape (2, 7), expected (2, 6)",
                   [&] { PlusRows(se3, wide, wide); });
  ExpectShapeError("origins has shape (3, 3)", [&] { MinusRows(se2, two, three); });
  ExpectShapeError("first has shape (1, 2), expected (1, 3)",
                   [&] { DeadReckonRows(se2, Eigen::Vector2d::Zero(), two); });
  ExpectShapeError("relative has shape (2, 7)",
                   [&] { DeadReckonRows(se2, Eigen::Vector3d::Zero(), wide); });
  ExpectShapeError("poses has shape (2, 3), expected (2, 7)",
                   [&] { WorldFromCameraRows(se3, camera, two); });
  ExpectShapeError("ellipsoids has shape (2, 3), expected (2, 9)",
                   [&] { ProjectToBoxesRows(se2, camera, two, two); });
  ExpectShapeError("ellipsoids has shape (2, 3), expected (2, 9)",
                   [&] { DifferentiateBoxesRows(se2, camera, two, two); });
  ExpectShapeError("poses has shape (2, 7), expected (2, 3)",
                   [&] { ProjectToOutlinesRows(se2, camera, wide, RowMatrix::Zero(2, 9), 9); });
  BodyTable bodies{{Shape::kCuboid, Shape::kCylinder}, two, RowMatrix::Zero(2, 9)};
  ExpectShapeError("centers has shape (2, 3), expected (3, 3)",
                   [&] { ProjectToBoxesRows(se2, camera, three, bodies); });
  bodies.shapes[1] = Shape::kEllipsoid;
  ExpectShapeError("shapes: expected a cuboid or a cylinder for each of 2 poses",
                   [&] { ProjectToBoxesRows(se2, camera, two, bodies); });
  ExpectShapeError("points: an outline needs at least 2",
                   [&] { ProjectToOutlinesRows(se2, camera, two, two, 1); });
  ExpectShapeError("a_from_b has shape (2, 3), expected (2, 7)", [&] { AdjointRows(se3, two); });
  ExpectShapeError("quadrics has shape (2, 7), expected (2, 9)",
                   [&] { DualQuadricShapeRows(wide); });
}

}  // namespace
}  // namespace dqslam
