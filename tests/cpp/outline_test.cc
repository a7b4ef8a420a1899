#include "dqslam/geometry/outline.h"

#include <gtest/gtest.h>

#include "cameras.h"
#include "oracle.h"
#include "random.h"

namespace dqslam {
namespace {

// The tangent cone of a sphere of radius 3 at a distance of 5 has a slope of 3 / 4.
TEST(ProjectToOutline, OfASphereStraightAheadByHand) {
  RowMatrix outline;
  ASSERT_TRUE(
      ProjectToOutline({{0, 0, 5}, 9 * Eigen::Matrix3d::Identity()}, MakeCamera(), 5, &outline));
  ASSERT_EQ(outline.rows(), 5);
  const RowMatrix away = outline.rowwise() - Eigen::RowVector2d(320, 240);
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(Eigen::Vector2d(away(i, 0) / 375, away(i, 1) / 300).norm(), 1, 1e-14);
  }
  EXPECT_NEAR(away.col(0).cwiseAbs().maxCoeff(), 375, 1e-12);
  EXPECT_NEAR(away.col(1).cwiseAbs().maxCoeff(), 300, 1e-12);
  EXPECT_LT((outline.row(4) - outline.row(0)).norm(), 1e-12);
}

// In any direction of the image the outline reaches as far as the sampled surface.
TEST(ProjectToOutline, HoldsTheSampledSurfaceAndNoMore) {
  Random random(1);
  const Camera camera = MakeCamera();
  for (int trial = 0; trial < 20; ++trial) {
    const oracle::Ellipsoid e{{random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(3, 8)},
                              random.UniformVector<3>(0.1, 1.2),
                              random.UnitQuaternion()};
    const Vector9d parameters = EllipsoidFromAxes(e.center, e.semi_axes, e.orientation_xyzw);
    RowMatrix outline;
    ASSERT_TRUE(ProjectToOutline(
        EllipsoidModel::Unpack(parameters.data()), camera, kOutlinePoints, &outline));
    const double angle = random.Uniform(0, 2 * M_PI);
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    const oracle::Surface surface(oracle::Viewpoint(), e);
    const auto reach = [&](const Eigen::Vector3d& d) {
      const Eigen::Vector3d p = surface.Point(d);
      return along.dot(Eigen::Vector2d(camera.fx * p.x() / p.z() + camera.cx,
                                       camera.fy * p.y() / p.z() + camera.cy));
    };
    const double expected = reach(oracle::ArgMax(reach));
    const double size = (outline.colwise().maxCoeff() - outline.colwise().minCoeff()).norm();
    EXPECT_NEAR((outline * along).maxCoeff(), expected, 1e-3 * size);
  }
}

TEST(ProjectToOutline, FailsUnlessStrictlyInFront) {
  RowMatrix outline;
  for (const double z : {-5.0, 0.0, 0.9, std::nan("")}) {
    EXPECT_FALSE(ProjectToOutline(
        {{0.1, 0, z}, Eigen::Matrix3d::Identity()}, MakeCamera(), kOutlinePoints, &outline));
  }
}

}  // namespace
}  // namespace dqslam
