#include "dqslam/solver/least_squares.h"

#include <ceres/crs_matrix.h>
#include <ceres/problem.h>
#include <gtest/gtest.h>

#include <Eigen/SparseCore>

#include "dqslam/estimation/information.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/solver/ceres_problem.h"
#include "scene.h"

namespace dqslam {
namespace {

/// Every kind of placement, on a plane of unknown height, and an unknown median of the sizes.
void AddPlacements(Graph* graph) {
  graph->shared_sigma = Eigen::Vector2d(1.0, 0.5);
  graph->size_prior.shared = IndexVector::Zero(graph->num_objects());
  graph->placements = {{Placement::kOn,
                        Placement::kOn,
                        Placement::kBeside,
                        Placement::kAligned,
                        Placement::kUpright},
                       (IndexVector(5) << 0, 2, 1, 2, 1).finished(),
                       (IndexVector(5) << -1, 1, 0, 0, -1).finished(),
                       (IndexVector(5) << 1, -1, -1, -1, -1).finished(),
                       Eigen::VectorXd::Constant(5, 0.1),
                       Eigen::VectorXd::Constant(5, 0.4)};
}

/// A scene off its truth, with every kind of term.
template <typename Pose>
struct Displaced {
  Displaced() : scene(MakeScene<Pose>()), state(scene.truth) {
    Random random(7);
    for (int pose = 1; pose < scene.graph.num_poses(); ++pose) {
      const Eigen::Matrix<double, Pose::kTangentSize, 1> tangent = random.RandomTangent<Pose>(0.01);
      const Eigen::VectorXd before = state.poses.row(pose).transpose();
      Plus<Pose>(before.data(), tangent.data(), state.poses.row(pose).data());
    }
    for (int object = 0; object < scene.graph.num_objects(); ++object) {
      state.landmarks.row(object) += random.UniformVector<9>(-0.02, 0.02).transpose();
    }
    scene.graph.scene_priors.upright_sigma = 0.2;
    scene.graph.scene_priors.support_sigma = 0.3;
    scene.graph.scene_priors.camera_height = 0.5;
    scene.graph.scene_priors.camera_height_sigma = 0.1;
    AddMeasurements(&scene.graph);
    AddPlacements(&scene.graph);
    state.shared = Eigen::Vector2d(0.2, -0.1);
    for (int row = 0; row < scene.graph.boxes.size(); row += 3) {
      scene.graph.boxes.truncated(row, 2) = true;
    }
  }
  Scene scene;
  State state;
};

/// Normal equations of the same stage by Ceres: poses, objects, then shared numbers, as ours.
struct Reference {
  Reference(const PreparedGraph& prepared,
            const SolveOptions& options,
            const Stage& stage,
            State state) {
    ceres::Problem problem;
    MakeCeresProblem({prepared, options, {}}, stage, &state, &problem);
    ceres::Problem::EvaluateOptions evaluate;
    for (int pose = stage.first_free_pose; pose < stage.end_pose; ++pose) {
      evaluate.parameter_blocks.push_back(state.poses.row(pose).data());
    }
    for (int object = 0; object < prepared.graph.num_objects(); ++object) {
      evaluate.parameter_blocks.push_back(state.landmarks.row(object).data());
    }
    for (double& shared : state.shared) evaluate.parameter_blocks.push_back(&shared);
    std::vector<double> residuals, slope;
    ceres::CRSMatrix crs;
    EXPECT_TRUE(problem.Evaluate(evaluate, &cost, &residuals, &slope, &crs));
    gradient = Eigen::Map<Eigen::VectorXd>(slope.data(), slope.size());
    const Eigen::SparseMatrix<double, Eigen::RowMajor> J =
        Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(crs.num_rows,
                                                                       crs.num_cols,
                                                                       crs.values.size(),
                                                                       crs.rows.data(),
                                                                       crs.cols.data(),
                                                                       crs.values.data());
    H = Eigen::MatrixXd(J).transpose() * Eigen::MatrixXd(J);
  }
  double cost = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd H;
};

Eigen::MatrixXd Dense(const BlockMatrix& H) {
  Eigen::MatrixXd dense(H.rows(), H.rows());
  for (int column = 0; column < H.rows(); ++column) {
    dense.col(column) = H.Multiply(Eigen::VectorXd::Unit(H.rows(), column));
  }
  return dense;
}

template <typename Pose>
class LeastSquaresOf : public testing::Test {
 protected:
  void ExpectCeres(const SolveOptions& options, const Stage& stage) {
    const PreparedGraph prepared(displaced_.scene.graph, false);
    const Reference expected(prepared, options, stage, state_);
    const auto problem = MakeLeastSquares({prepared, options, {}}, stage, state_);
    const Eigen::VectorXd values = problem->Pack(state_);
    double cost = 0;
    ASSERT_TRUE(problem->Cost(values, &cost));
    ASSERT_TRUE(problem->Linearize(values));
    const NormalEquations& equations = problem->equations();
    EXPECT_NEAR(cost, expected.cost, 1e-10 * expected.cost);
    EXPECT_NEAR(equations.cost, expected.cost, 1e-10 * expected.cost);
    ASSERT_EQ(equations.gradient.size(), expected.gradient.size());
    EXPECT_LT((equations.gradient - expected.gradient).cwiseAbs().maxCoeff(),
              1e-9 * expected.gradient.cwiseAbs().maxCoeff());
    const Eigen::MatrixXd H = Dense(equations.H);
    EXPECT_LT((H - expected.H).cwiseAbs().maxCoeff(), 1e-9 * expected.H.cwiseAbs().maxCoeff());
  }

  Stage AllOf(Residual residual) const {
    Stage stage;
    stage.end_pose = displaced_.scene.graph.num_poses();
    for (int row = 0; row < displaced_.scene.graph.boxes.size(); ++row) stage.boxes.push_back(row);
    stage.residual = residual;
    return stage;
  }

  Displaced<Pose> displaced_;
  State state_ = displaced_.state;
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(LeastSquaresOf, PoseTypes);

TYPED_TEST(LeastSquaresOf, EveryResidualGivesTheEquationsOfCeres) {
  for (const Residual residual : {Residual::kBox, Residual::kTangent}) {
    SCOPED_TRACE(static_cast<int>(residual));
    this->ExpectCeres({}, this->AllOf(residual));
  }
}

TYPED_TEST(LeastSquaresOf, EveryLossDoes) {
  for (const Loss loss : {Loss::kHuber, Loss::kCauchy, Loss::kDcs}) {
    SCOPED_TRACE(static_cast<int>(loss));
    Stage stage = this->AllOf(Residual::kBox);
    stage.loss = loss;
    this->ExpectCeres({}, stage);
  }
}

TYPED_TEST(LeastSquaresOf, SoDoWeights) {
  Stage stage = this->AllOf(Residual::kBox);
  for (size_t i = 0; i < stage.boxes.size(); ++i) stage.weights.push_back(0.2 * (1 + i % 5));
  this->ExpectCeres({}, stage);
}

TYPED_TEST(LeastSquaresOf, ConstantPosesHaveNoColumns) {
  Stage stage = this->AllOf(Residual::kTangent);
  stage.first_free_pose = stage.end_pose / 2;
  this->ExpectCeres({}, stage);
}

TYPED_TEST(LeastSquaresOf, ValuesComeBackAsTheyWere) {
  const PreparedGraph prepared(this->displaced_.scene.graph, false);
  const auto problem =
      MakeLeastSquares({prepared, {}, {}}, this->AllOf(Residual::kBox), this->state_);
  State back = this->displaced_.scene.truth;
  back.poses.row(0) = this->state_.poses.row(0);  // it is constant
  problem->Unpack(problem->Pack(this->state_), &back);
  EXPECT_EQ(back.poses, this->state_.poses);
  EXPECT_EQ(back.landmarks, this->state_.landmarks);
}

// What differs falls with the square of the step.
TYPED_TEST(LeastSquaresOf, AlongThePathIsPlusToFirstOrder) {
  const PreparedGraph prepared(this->displaced_.scene.graph, false);
  Stage stage = this->AllOf(Residual::kBox);
  const SolveOptions options;
  const auto problem = MakeLeastSquares({prepared, options, {}}, stage, this->state_);
  const Eigen::VectorXd values = problem->Pack(this->state_);
  Random random(8);
  const Eigen::VectorXd step = Eigen::VectorXd::NullaryExpr(problem->equations().H.rows(),
                                                            [&] { return random.Uniform(-1, 1); });
  double differences[2];
  for (int half = 0; half < 2; ++half) {
    const double h = half == 0 ? 1e-4 : 5e-5;
    Eigen::VectorXd straight, along_path;
    ASSERT_TRUE(problem->Retract(values, h * step, &straight));
    ASSERT_TRUE(problem->RetractAlongPath(values, h * step, &along_path));
    EXPECT_GT((straight - values).norm(), 1e-4);
    differences[half] = (along_path - straight).norm();
  }
  EXPECT_LT(differences[0], 1e-4);
  EXPECT_NEAR(differences[0] / differences[1], 4, 0.1);
}

// Covariances come from the same terms, for every residual and both landmark models.
TYPED_TEST(LeastSquaresOf, InformationIsThatOfCeres) {
  for (const LandmarkModel model : {LandmarkModel::kEllipsoid, LandmarkModel::kDualQuadric}) {
    SolveOptions options;
    options.loss = Loss::kNone;
    options.landmark_model = model;
    State state = this->state_;
    if (model == LandmarkModel::kDualQuadric) {
      for (Eigen::Index row = 0; row < state.landmarks.rows(); ++row) {
        state.landmarks.row(row) = DualQuadricFromEllipsoid(state.landmarks.row(row).transpose());
      }
    }
    for (const Residual residual : {Residual::kBox,
                                    Residual::kTangent,
                                    Residual::kAlgebraic,
                                    Residual::kAlgebraicNormalized}) {
      SCOPED_TRACE(static_cast<int>(residual));
      options.residual = residual;
      const Graph& graph = this->displaced_.scene.graph;
      const Reference expected(PreparedGraph(graph, false), options, this->AllOf(residual), state);
      const Information found = ComputeInformation(graph, options, state);
      EXPECT_NEAR(0.5 * found.residuals.squaredNorm(), expected.cost, 1e-10 * expected.cost);
      const Eigen::MatrixXd H = Dense(found.H);
      ASSERT_EQ(H.rows(), expected.H.rows());
      EXPECT_LT((H - expected.H).cwiseAbs().maxCoeff(), 1e-9 * expected.H.cwiseAbs().maxCoeff());
    }
  }
}

TYPED_TEST(LeastSquaresOf, AnObjectBehindTheCameraHasNoCost) {
  const PreparedGraph prepared(this->displaced_.scene.graph, false);
  const auto problem =
      MakeLeastSquares({prepared, {}, {}}, this->AllOf(Residual::kBox), this->state_);
  State far = this->state_;
  far.landmarks.col(0).array() += 1000;
  double cost = 0;
  EXPECT_FALSE(problem->Cost(problem->Pack(far), &cost));
}

}  // namespace
}  // namespace dqslam
