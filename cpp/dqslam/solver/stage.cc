#include "dqslam/solver/stage.h"

#include <ceres/problem.h>

#include "dqslam/costs/box_chi_square.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/solver/assembly.h"
#include "dqslam/solver/ceres_backend.h"
#include "dqslam/solver/trust_region.h"

namespace dqslam {
Summary Optimize(const PreparedGraph& prepared,
                 const SolveOptions& options,
                 const Stage& stage,
                 const Monitor& monitor,
                 State* state) {
  const TrustRegionOptions method{stage.minimizer, stage.max_iterations, stage.function_tolerance};
  Summary summary;
  if (options.backend == Backend::kCeres) {
    ceres::Problem problem;
    Assemble(prepared, options, stage, state, &problem);
    summary = MinimizeByCeres(method, monitor, &problem);
  } else {
    const auto problem = MakeLeastSquares(prepared, options, stage, *state);
    Eigen::VectorXd values = problem->Pack(*state);
    summary = Minimize(method, monitor, problem.get(), &values);
    problem->Unpack(values, state);
  }
  if (summary.rejected_steps > 0 && summary.rejected_steps == summary.iterations) {
    summary.converged = false;
    summary.message = "every step was rejected: " + summary.message;
  }
  return summary;
}

Eigen::VectorXd BoxCosts(const PreparedGraph& prepared,
                         const SolveOptions& options,
                         const State& state) {
  const Graph& graph = prepared.graph;
  Eigen::VectorXd costs(graph.boxes.size());
  Dispatch(graph.pose_model, options.landmark_model, [&](auto pose_model, auto landmark) {
    using Pose = decltype(pose_model);
    using Landmark = decltype(landmark);
    for (int row = 0; row < graph.boxes.size(); ++row) {
      const double* pose = state.poses.row(graph.boxes.pose[row]).data();
      const double* parameters = state.landmarks.row(graph.boxes.object[row]).data();
      const Surface<double> surface =
          ToCamera(LocateCamera<Pose>(pose, prepared.mount), Landmark::Unpack(parameters));
      costs[row] = 0.5 * BoxChiSquare(surface,
                                      graph.camera,
                                      graph.boxes.box.row(row),
                                      graph.boxes.truncated.row(row),
                                      prepared.box_sqrt_information[row]);
    }
  });
  return costs;
}

}  // namespace dqslam
