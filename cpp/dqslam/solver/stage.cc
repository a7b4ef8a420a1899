#include "dqslam/solver/stage.h"

#include <ceres/problem.h>

#include "dqslam/costs/box_chi_square.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/solver/ceres_backend.h"
#include "dqslam/solver/ceres_problem.h"
#include "dqslam/solver/trust_region.h"

namespace dqslam {
namespace {

bool NeedsCeres(const SolveOptions& options, const Stage& stage) {
  return options.backend == Backend::kCeres || IsAlgebraic(stage.residual) ||
         options.landmark_model != LandmarkModel::kEllipsoid || stage.loss == Loss::kSwitchable;
}

}  // namespace

Summary Optimize(const SolveContext& context, const Stage& stage, State* state) {
  const TrustRegionOptions method{stage.minimizer, stage.max_iterations, stage.function_tolerance};
  Summary summary;
  if (NeedsCeres(context.options, stage)) {
    ceres::Problem problem;
    MakeCeresProblem(context, stage, state, &problem);
    summary = MinimizeByCeres(method, context.monitor, &problem);
  } else {
    const auto problem = MakeLeastSquares(context, stage, *state);
    Eigen::VectorXd values = problem->Pack(*state);
    summary = Minimize(method, context.monitor, problem.get(), &values);
    problem->Unpack(values, state);
  }
  return summary;
}

Eigen::VectorXd BoxCosts(const SolveContext& context, const State& state) {
  const Graph& graph = context.graph();
  Eigen::VectorXd costs(graph.boxes.size());
  Dispatch(graph.pose_model, context.options.landmark_model, [&](auto pose_model, auto landmark) {
    using Pose = decltype(pose_model);
    using Landmark = decltype(landmark);
    for (int row = 0; row < graph.boxes.size(); ++row) {
      const double* pose = state.poses.row(graph.boxes.pose[row]).data();
      const double* parameters = state.landmarks.row(graph.boxes.object[row]).data();
      const Surface<double> surface =
          ToCamera(LocateCamera<Pose>(pose, context.prepared.mount), Landmark::Unpack(parameters));
      costs[row] = 0.5 * BoxChiSquare(surface,
                                      graph.camera,
                                      graph.boxes.box.row(row),
                                      graph.boxes.truncated.row(row),
                                      context.prepared.box_sqrt_information[row]);
    }
  });
  return costs;
}

}  // namespace dqslam
