#include <gtest/gtest.h>

#include "cost_checks.h"
#include "dqslam/costs/box.h"
#include "dqslam/costs/tangent.h"
#include "dqslam/estimation/solve.h"
#include "scene.h"

namespace dqslam {
namespace {

TEST(IgnoreBeyond, DropsOnlyWhatGoesOnBeyondACutEdge) {
  EdgeFlags one_sided;
  one_sided << true, true, true, false;
  Eigen::Vector4d error(-3, 2, 5, 7);  // predicted - observed
  IgnoreBeyond(one_sided, &error);
  EXPECT_EQ(error, Eigen::Vector4d(0, 2, 0, 7));
}

// A sphere touches its box where the ray to the edge is perpendicular to the radius.
TEST(TouchingPoints, LieOnTheOutlineOfASphere) {
  Camera camera = SceneCamera();
  const Surface<double> sphere{{0.4, -0.3, 3}, 0.25 * Eigen::Matrix3d::Identity()};
  Eigen::Vector4d box;
  ASSERT_TRUE(ProjectToBox(sphere, camera, &box));
  const Eigen::Matrix<double, 4, 2> points = TouchingPoints(sphere, camera, box);
  for (int edge = 0; edge < 4; ++edge) {
    EXPECT_NEAR(points(edge, edge % 2), box[edge], 1e-9);
    const Eigen::Vector3d ray(
        (points(edge, 0) - camera.cx) / camera.fx, (points(edge, 1) - camera.cy) / camera.fy, 1);
    EXPECT_NEAR(ray.normalized().cross(sphere.center).norm(), 0.5, 1e-9);
  }
}

// Both residuals agree on which side of a cut edge counts.
TEST(OneSidedEdges, CountOnlyWhereTheObjectEndsInside) {
  const Scene scene = MakeScene<Se2>();
  const Graph& graph = scene.graph;
  const Eigen::Vector3d pose = scene.truth.poses.row(graph.boxes.pose[0]);
  const Vector9d landmark = scene.truth.landmarks.row(graph.boxes.object[0]);
  const std::vector<Block> blocks = {PoseBlock<Se2>(pose), LandmarkBlock(landmark)};
  const Mount mount(graph.camera);
  const Eigen::Vector4d exact = graph.boxes.box.row(0);
  EdgeFlags right_cut = EdgeFlags::Constant(false);
  right_cut[2] = true;
  for (const double shift : {-10.0, 10.0}) {  // of the observed right edge
    const Eigen::Vector4d observed = exact + Eigen::Vector4d(0, 0, shift, 0);
    const CostPointer box(BoxCost<Se2, EllipsoidModel>::Create(
        graph.camera, mount, observed, Eigen::Matrix4d(Eigen::Matrix4d::Identity()), right_cut));
    const CostPointer tangent(
        TangentCost<Se2, EllipsoidModel>::Create(graph.camera,
                                                 mount,
                                                 observed,
                                                 Eigen::Matrix4d(Eigen::Matrix4d::Identity()),
                                                 4.0,
                                                 right_cut));
    const double expected = shift < 0 ? 0 : -shift;
    EXPECT_NEAR(ResidualOf(*box, blocks)[2], expected, 1e-3);
    const double distance = ResidualOf(*tangent, blocks)[2];
    EXPECT_TRUE(shift < 0 ? distance == 0 : distance < -1) << distance;
  }
}

// Boxes cut at a border that runs through the objects: as flags they do no harm, as measurements
// they do.
TEST(TruncatedBoxes, DoNotPullObjects) {
  Scene scene = MakeScene<Se3>();
  BoxTable& boxes = scene.graph.boxes;
  const double border = 0.55 * scene.graph.camera.width;
  scene.graph.camera.width = static_cast<int>(border + 0.5);
  std::vector<int> kept;
  for (int row = 0; row < boxes.size(); ++row) {
    if (boxes.box(row, 0) < border - 20) kept.push_back(row);
  }
  BoxTable cut{IndexVector(boxes.pose(kept)),
               IndexVector(boxes.object(kept)),
               RowMatrix(boxes.box(kept, Eigen::all)),
               RowMatrix(boxes.covariance(kept, Eigen::all)),
               BoolTable::Constant(kept.size(), 4, false)};
  const double limit = scene.graph.camera.width - 0.5;
  int truncated = 0;
  for (int row = 0; row < cut.size(); ++row) {
    cut.truncated(row, 2) = cut.box(row, 2) > limit;
    truncated += cut.truncated(row, 2);
    cut.box(row, 2) = std::min(cut.box(row, 2), limit);
    // What the detector sees of an object that goes on: its top and bottom may lie beyond the
    // border.
  }
  EXPECT_GT(truncated, cut.size() / 10);
  const auto center_error = [&] {
    SolveOptions options;
    options.mode = Mode::kMapping;
    options.loss = Loss::kNone;
    const Solution solution = Solve(scene.graph, options, {});
    return (solution.landmarks - scene.truth.landmarks).leftCols<3>().rowwise().norm().maxCoeff();
  };
  boxes = cut;
  EXPECT_LT(center_error(), 1e-3);
  boxes.truncated.setConstant(false);
  EXPECT_GT(center_error(), 1e-2);
}

}  // namespace
}  // namespace dqslam
