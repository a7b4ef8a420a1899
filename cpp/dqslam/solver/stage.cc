#include "dqslam/solver/stage.h"

#include <ceres/problem.h>

#include <numeric>

#include "dqslam/costs/box_chi_square.h"
#include "dqslam/linear/parallel.h"
#include "dqslam/solver/ceres_backend.h"
#include "dqslam/solver/ceres_problem.h"
#include "dqslam/solver/stage_terms.h"
#include "dqslam/solver/trust_region.h"
#include "dqslam/solver/visit_object.h"

namespace dqslam {
namespace {

bool NeedsCeres(const SolveOptions& options, const Stage& stage) {
  return options.backend == Backend::kCeres || IsAlgebraic(stage.residual) ||
         options.landmark_model != LandmarkModel::kEllipsoid || stage.loss == Loss::kSwitchable;
}

}  // namespace

Summary Optimize(const SolveContext& context, const Stage& stage, State* state) {
  const TrustRegionOptions method{
      stage.minimizer, stage.max_iterations, stage.function_tolerance, context.options.threads};
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
  std::vector<int> rows(context.graph().boxes.size());
  std::iota(rows.begin(), rows.end(), 0);
  return BoxCosts(context, state, rows);
}

Eigen::VectorXd BoxCosts(const SolveContext& context,
                         const State& state,
                         const std::vector<int>& rows) {
  const Graph& graph = context.graph();
  Eigen::VectorXd costs(rows.size());
  const auto evaluate = [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t i = begin; i < end; ++i) {
      const int row = rows[i];
      const CameraInWorld<double> camera =
          LocateCamera(context.prepared, state, graph.boxes.pose[row]);
      VisitObject(context.options, state, graph.boxes.object[row], [&](const auto& in_world) {
        costs[i] = 0.5 * BoxChiSquare(ToCamera(camera, in_world),
                                      graph.camera,
                                      graph.boxes.box.row(row),
                                      graph.boxes.truncated.row(row),
                                      context.prepared.box_sqrt_information[row]);
      });
    }
  };
  ParallelForParts(context.options.threads, costs.size(), kBoxesPerPart, evaluate);
  return costs;
}

}  // namespace dqslam
