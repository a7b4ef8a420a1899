#include "dqslam/solver/ceres_problem.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>

#include <cmath>

#include "dqslam/costs/switched.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/geometry/manifolds.h"
#include "dqslam/solver/loss.h"
#include "dqslam/solver/terms.h"

namespace dqslam {
namespace {

// A visitor that adds each term as a residual block.
template <typename Pose, typename Landmark>
class ResidualBlocks {
 public:
  ResidualBlocks(const SolveContext& context, Loss loss, State* state, ceres::Problem* problem)
      : context_(context), loss_(loss), state_(*state), problem_(*problem) {}

  void AddVariables(const StageTerms& terms) {
    const VariableIndex& variables = terms.variables;
    auto* manifold = new PoseManifold<Pose>;  // owned by the problem, shared by all poses
    for (int pose = 0; pose < variables.end_pose; ++pose) {
      double* parameters = ParametersOf(PoseRow{pose});
      problem_.AddParameterBlock(parameters, Pose::kSize, manifold);
      if (pose < variables.first_free_pose) problem_.SetParameterBlockConstant(parameters);
    }
    if (state_.shared.size() == 0) state_.shared.setZero(variables.num_shared);
    for (int row = 0; row < variables.num_shared; ++row) {
      problem_.AddParameterBlock(ParametersOf(SharedRow{row}), 1);
      if (!variables.moves_shared) {
        problem_.SetParameterBlockConstant(ParametersOf(SharedRow{row}));
      }
    }
    EllipsoidManifold* of_ellipsoids = nullptr;
    for (const int object : variables.objects) {
      double* parameters = ParametersOf(ObjectRow{object});
      problem_.AddParameterBlock(parameters, kLandmarkSize);
      if (Landmark::kModel != LandmarkModel::kEllipsoid ||
          ShapeOf(terms.shapes, object) != Shape::kEllipsoid) {
        continue;
      }
      if (!of_ellipsoids) of_ellipsoids = new EllipsoidManifold;
      problem_.SetManifold(parameters, of_ellipsoids);
    }
  }

  template <typename Cost, typename... Rows>
  bool Visit(const Cost& cost, const Rows&... rows) {
    problem_.AddResidualBlock(Cost::CreateFrom(cost), nullptr, ParametersOf(rows)...);
    return true;
  }

  bool VisitBox(const StageBox& box) {
    const BoxTable& boxes = context_.graph().boxes;
    double* pose = ParametersOf(PoseRow{boxes.pose[box.row]});
    double* object = ParametersOf(ObjectRow{boxes.object[box.row]});
    return VisitBoxCost<Pose, Landmark>(context_, box, [&](const auto& cost) {
      using Cost = std::decay_t<decltype(cost)>;
      if (loss_ == Loss::kSwitchable) {
        const double sqrt_phi = std::sqrt(context_.options.outlier_chi_square);
        problem_.AddResidualBlock(SwitchedCost<Pose, Cost>::Create(cost, sqrt_phi),
                                  nullptr,
                                  pose,
                                  object,
                                  &state_.switches[box.row]);
        return true;
      }
      ceres::LossFunction* loss = MakeLoss(loss_, context_.options).release();
      if (box.weight != 1) loss = new ceres::ScaledLoss(loss, box.weight, ceres::TAKE_OWNERSHIP);
      problem_.AddResidualBlock(Cost::CreateFrom(cost), loss, pose, object);
      return true;
    });
  }

 private:
  double* ParametersOf(PoseRow pose) { return state_.poses.row(pose.row).data(); }
  double* ParametersOf(ObjectRow object) { return state_.landmarks.row(object.row).data(); }
  double* ParametersOf(SharedRow shared) { return &state_.shared[shared.row]; }

  const SolveContext& context_;
  Loss loss_;
  State& state_;
  ceres::Problem& problem_;
};

}  // namespace

void MakeCeresProblem(const SolveContext& context,
                      const Stage& stage,
                      State* state,
                      ceres::Problem* problem) {
  const StageTerms terms = SelectTerms(context, stage, *state);
  Dispatch(
      context.graph().pose_model, context.options.landmark_model, [&](auto pose, auto landmark) {
        using Pose = decltype(pose);
        using Landmark = decltype(landmark);
        ResidualBlocks<Pose, Landmark> blocks(context, stage.loss, state, problem);
        blocks.AddVariables(terms);
        VisitTerms<Pose, Landmark>(context.prepared, terms, &blocks);
      });
}

}  // namespace dqslam
