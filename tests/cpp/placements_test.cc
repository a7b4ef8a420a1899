#include "dqslam/costs/placements.h"

#include <gtest/gtest.h>

#include "cost_checks.h"
#include "dqslam/costs/shared.h"
#include "dqslam/estimation/covariance.h"
#include "dqslam/estimation/placement_misfits.h"
#include "dqslam/estimation/solve.h"
#include "random.h"
#include "scene.h"

namespace dqslam {
namespace {

using Eigen::Vector3d;

const Vector3d kUp = Vector3d::UnitZ();
const EllipsoidModel kEllipsoid;
const BodyModel kCuboid{Shape::kCuboid, 0.0};

Block Ellipsoid(const Vector3d& center, const Vector3d& semi_axes, double yaw = 0) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw, kUp));
  return LandmarkBlock(EllipsoidFromAxes(center, semi_axes, turn.coeffs()));
}

Block Cuboid(const Vector3d& center, const Vector3d& half_lengths, double yaw = 0) {
  Vector9d parameters;
  parameters << center, half_lengths.array().log().matrix(), 0, 0, yaw;
  return LandmarkBlock(parameters);
}

Block Shared(double value) {
  return {Eigen::VectorXd::Constant(1, value), std::make_shared<ceres::EuclideanManifold<1>>()};
}

// A residual of r sigmas after its switch.
double Bounded(double r) {
  return r / std::sqrt(1 + r * r / 9);
}

TEST(OnPlaneCost, MeasuresTheLowestPointAboveThePlane) {
  const CostPointer round(OnPlaneCost<EllipsoidModel>::Create(kEllipsoid, kUp, 0.7, 0.1));
  const Block vase = Ellipsoid({5, 6, 1.4}, {0.2, 0.3, 0.5});  // its lowest point is at 0.9
  EXPECT_NEAR(ResidualOf(*round, {vase, Shared(0.2)})[0], 0, 1e-12);
  EXPECT_NEAR(ResidualOf(*round, {vase, Shared(0.0)})[0], Bounded(2), 1e-12);
  const CostPointer square(OnPlaneCost<BodyModel>::Create(kCuboid, kUp, 0.7, 0.1));
  const Block box = Cuboid({5, 6, 1.4}, {0.2, 0.3, 0.5}, 0.3);
  EXPECT_NEAR(ResidualOf(*square, {box, Shared(-0.1)})[0], Bounded(3), 1e-12);
}

TEST(OnObjectCost, MeasuresTheGapBetweenTopAndBottom) {
  using Cost = OnObjectCost<EllipsoidModel, BodyModel>;
  const CostPointer cost(Cost::Create(kEllipsoid, kCuboid, kUp, 0.1));
  const Block table = Cuboid({0, 0, 0.4}, {1.0, 0.5, 0.4});  // its top is at 0.8
  EXPECT_NEAR(ResidualOf(*cost, {Ellipsoid({0, 0, 0.9}, {0.1, 0.1, 0.1}), table})[0], 0, 1e-12);
  EXPECT_NEAR(
      ResidualOf(*cost, {Ellipsoid({0, 0, 0.8}, {0.1, 0.1, 0.1}), table})[0], Bounded(-1), 1e-12);
}

TEST(BesideCost, IsZeroUpToTheDistance) {
  using Cost = BesideCost<EllipsoidModel, EllipsoidModel>;
  const CostPointer cost(Cost::Create(kEllipsoid, kEllipsoid, kUp, 1.0, 0.5));
  const Vector3d size(0.1, 0.1, 0.1);
  const Block monitor = Ellipsoid({0, 0, 3}, size);
  EXPECT_EQ(ResidualOf(*cost, {Ellipsoid({0.9, 0, 0}, size), monitor})[0], 0);
  EXPECT_NEAR(ResidualOf(*cost, {Ellipsoid({1.2, 1.6, 0}, size), monitor})[0], Bounded(2), 1e-12);
}

TEST(AlignedCost, IsZeroAtRightAnglesAndWhereOneIsRound) {
  using Cost = AlignedCost<EllipsoidModel, EllipsoidModel>;
  const CostPointer cost(Cost::Create(kEllipsoid, kEllipsoid, kUp, 0.1));
  const Vector3d size(0.5, 0.1, 0.2);
  const Block desk = Ellipsoid({0, 0, 0}, size, 0.4);
  for (const double turn : {0.0, M_PI / 2, M_PI}) {
    EXPECT_NEAR(ResidualOf(*cost, {Ellipsoid({1, 2, 3}, size, 0.4 + turn), desk})[0], 0, 1e-12);
  }
  // The outlines have (a - b) / (a + b) = 12 / 13, which a round one of 0.05 hardly changes.
  const double sharp = 12.0 / 13, share = sharp * sharp / (sharp * sharp + 0.05 * 0.05);
  const double r = std::sin(4 * 0.05) / 4 / 0.1;
  EXPECT_NEAR(std::abs(ResidualOf(*cost, {Ellipsoid({1, 2, 3}, size, 0.45), desk})[0]),
              Bounded(r * share * share),
              2e-3);
  const Block can = Ellipsoid({1, 2, 3}, {0.3, 0.3, 0.9});
  EXPECT_NEAR(ResidualOf(*cost, {can, desk})[0], 0, 1e-12);
}

TEST(PlumbCost, GrowsWithTheTilt) {
  const CostPointer cost(PlumbCost<EllipsoidModel>::Create(kEllipsoid, kUp, 0.5));
  const Block upright = Ellipsoid({1, 2, 3}, {0.2, 0.3, 0.9}, 0.7);
  EXPECT_LT(ResidualOf(*cost, {upright}).norm(), 1e-14);
  // A small tilt about x: angle times (1 - b^2 / c^2), here b = 0.3, c = 0.9.
  const double tilt = 1e-4;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(tilt, Vector3d::UnitX()));
  const Block tilted = LandmarkBlock(EllipsoidFromAxes({1, 2, 3}, {0.2, 0.3, 0.9}, turn.coeffs()));
  EXPECT_NEAR(ResidualOf(*cost, {tilted}).norm(), tilt * (1 - 1.0 / 9) / 0.5, 1e-9);
}

TEST(Placements, CostNoMoreThanTheirSwitch) {
  const CostPointer cost(OnPlaneCost<EllipsoidModel>::Create(kEllipsoid, kUp, 0.0, 0.01));
  const double r = ResidualOf(*cost, {Ellipsoid({0, 0, 900}, {1, 1, 1}), Shared(0)})[0];
  EXPECT_LT(0.5 * r * r, 4.5);
  EXPECT_GT(0.5 * r * r, 4.499);
}

TEST(Placements, JacobiansMatchPerturbation) {
  Random random(1);
  const Vector3d up = random.UnitQuaternion().head<3>().normalized();
  const BodyModel body = RoundedModel(Shape::kCuboid);
  using Both = OnObjectCost<EllipsoidModel, BodyModel>;
  const CostPointer plane(OnPlaneCost<EllipsoidModel>::Create(kEllipsoid, up, 0.5, 0.7));
  const CostPointer body_plane(OnPlaneCost<BodyModel>::Create(body, up, 0.5, 0.7));
  const CostPointer on(Both::Create(kEllipsoid, body, up, 0.8));
  const CostPointer beside(
      BesideCost<EllipsoidModel, BodyModel>::Create(kEllipsoid, body, up, 0.2, 0.9));
  const CostPointer aligned(
      AlignedCost<EllipsoidModel, BodyModel>::Create(kEllipsoid, body, up, 0.3));
  const CostPointer plumb(PlumbCost<BodyModel>::Create(body, up, 0.3));
  const CostPointer median(
      SharedMedianCost<SizePriorCost>::Create(SizePriorCost{{}, std::log(0.3), 0.5}));
  for (int trial = 0; trial < 30; ++trial) {
    const Block object = LandmarkBlock(EllipsoidFromAxes(
        random.UniformVector<3>(-3, 3), random.UniformVector<3>(0.2, 1), random.UnitQuaternion()));
    Vector9d parameters;
    parameters << random.UniformVector<3>(-3, 3),
        random.UniformVector<3>(0.2, 1).array().log().matrix(), random.UniformVector<3>(-1, 1);
    const Block other = LandmarkBlock(parameters);
    ExpectJacobiansMatchPerturbation(*plane, {object, Shared(0.3)});
    ExpectJacobiansMatchPerturbation(*body_plane, {other, Shared(0.3)});
    ExpectJacobiansMatchPerturbation(*on, {object, other});
    ExpectJacobiansMatchPerturbation(*beside, {object, other});
    ExpectJacobiansMatchPerturbation(*aligned, {object, other});
    ExpectJacobiansMatchPerturbation(*plumb, {other});
    ExpectJacobiansMatchPerturbation(*median, {object, Shared(0.3)});
  }
}

// The prior is a factor of 10 off; as a shared number, its median is found.
TEST(SharedNumbers, TakeUpAWrongMedian) {
  Scene scene = MakeScene<Se2>();
  Graph& graph = scene.graph;
  double mean = 0;
  for (int object = 0; object < graph.num_objects(); ++object) {
    const Vector9d parameters = scene.truth.landmarks.row(object).transpose();
    mean += AxesFromEllipsoid(parameters).semi_axes.array().log().mean() / graph.num_objects();
  }
  graph.size_prior.log_mean.setConstant(mean + std::log(10));
  graph.size_prior.log_sigma.setConstant(0.5);
  graph.size_prior.shared = IndexVector::Zero(graph.num_objects());
  graph.shared_sigma = Eigen::VectorXd::Constant(1, 2.0);
  const Solution solution = Solve(graph, SolveOptions());
  ASSERT_EQ(solution.shared.size(), 1);
  const double sigma = 0.5 / std::sqrt(3.0 * graph.num_objects());  // with exact sizes
  EXPECT_NEAR(solution.shared[0], -std::log(10), 0.2);
  const State state{solution.poses, solution.landmarks, {}, {}, solution.shared};
  const Covariance covariance = ComputeCovariance(graph, SolveOptions(), state);
  EXPECT_GT(std::sqrt(covariance.shared[0]), 0.99 * sigma);
  EXPECT_LT(std::sqrt(covariance.shared[0]), 2 * sigma);
}

// Objects on one plane of unknown height; a placement that is wrong by a meter does no harm.
TEST(SharedNumbers, FindTheHeightOfAPlane) {
  Scene scene = MakeScene<Se2>();
  Graph& graph = scene.graph;
  const int objects = graph.num_objects();
  ASSERT_GE(objects, 4);
  const Solution before = Solve(graph, SolveOptions());
  PlacementTable& table = graph.placements;
  table.kind.assign(objects, Placement::kOn);
  table.object = IndexVector::LinSpaced(objects, 0, objects - 1);
  table.other = IndexVector::Constant(objects, -1);
  table.shared = IndexVector::Zero(objects);
  table.distance.resize(objects);
  table.sigma = Eigen::VectorXd::Constant(objects, 0.01);
  for (int object = 0; object < objects; ++object) {
    const Surface<double> surface =
        EllipsoidModel::Unpack(scene.truth.landmarks.row(object).data());
    // The plane is 0.3 m above the lowest point of each but the last one.
    table.distance[object] = surface.center.z() - std::sqrt(surface.shape(2, 2)) - 0.3 +
                             (object == objects - 1 ? 1.0 : 0.0);
  }
  graph.shared_sigma = Eigen::VectorXd::Constant(1, 1.0);
  const Solution solution = Solve(graph, SolveOptions());
  EXPECT_NEAR(solution.shared[0], 0.3, 0.01);
  const Eigen::RowVectorXd moved =
      solution.landmarks.row(objects - 1) - before.landmarks.row(objects - 1);
  EXPECT_LT(moved.head<3>().norm(), 0.02);
  const State state{solution.poses, solution.landmarks, {}, {}, solution.shared};
  const Eigen::VectorXd misfits = PlacementMisfits(graph, SolveOptions(), state);
  EXPECT_LT(misfits.head(objects - 1).maxCoeff(), 1);
  EXPECT_NEAR(misfits[objects - 1], 100, 5);  // 1 m, of 0.01 m
}

TEST(Placements, ThatNameNothingAreRefused) {
  Scene scene = MakeScene<Se2>();
  const auto refuse = [&](Placement kind, int other, int shared, double sigma, const char* text) {
    scene.graph.placements = {{kind},
                              IndexVector::Zero(1),
                              IndexVector::Constant(1, other),
                              IndexVector::Constant(1, shared),
                              Eigen::VectorXd::Zero(1),
                              Eigen::VectorXd::Constant(1, sigma)};
    try {
      Validate(scene.graph, false);
      ADD_FAILURE() << text;
    } catch (const std::invalid_argument& error) {
      EXPECT_STREQ(error.what(), text);
    }
  };
  refuse(Placement::kOn, -1, -1, 1, "placement_other row 0: must be an object");
  refuse(Placement::kUpright, 1, -1, 1, "placement_other row 0: must be -1");
  refuse(Placement::kAligned, 0, -1, 1, "placement_other row 0: is neither -1 nor another object");
  refuse(
      Placement::kOn, -1, 0, 1, "placement_shared row 0: is neither -1 nor a row of shared_sigma");
  refuse(Placement::kBeside, 1, -1, 0, "placement_sigma row 0: must be positive");
  refuse(Placement::kBeside, 1, -1, 1e-300, "placement_sigma row 0: must be at least 1e-9");
}

}  // namespace
}  // namespace dqslam
