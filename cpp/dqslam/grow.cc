#include "dqslam/grow.h"

#include <algorithm>

#include "dqslam/robust.h"

namespace dqslam {
namespace {

Vector9d InModel(const Vector9d& ellipsoid, LandmarkModel model) {
  return model == LandmarkModel::kEllipsoid ? ellipsoid : DualQuadricFromEllipsoid(ellipsoid);
}

}  // namespace

std::vector<View> ViewsOf(const PreparedGraph& prepared,
                          const State& state,
                          const std::vector<int>& boxes) {
  std::vector<View> views;
  for (const int row : boxes) {
    views.push_back({LocateCamera(prepared, state, prepared.graph.boxes.pose[row]),
                     prepared.graph.boxes.box.row(row),
                     prepared.box_sqrt_information[row],
                     prepared.graph.boxes.truncated.row(row)});
  }
  return views;
}

Vector9d StartObject(const PreparedGraph& prepared,
                     const SolveOptions& options,
                     const State& state,
                     int object,
                     const std::vector<int>& boxes) {
  const Graph& graph = prepared.graph;
  const std::vector<View> views = ViewsOf(prepared, state, boxes);
  const SizePrior prior{graph.size_prior.log_mean[object], graph.size_prior.log_sigma[object]};
  const bool unconstrained = options.landmark_model == LandmarkModel::kDualQuadric;
  switch (options.start) {
    case Start::kIdentity:
      return unconstrained ? IdentityQuadric() : Sphere(Eigen::Vector3d::Zero(), 1);
    case Start::kSizePrior:
      return InModel(BackProject(graph.camera, views, prior), options.landmark_model);
    case Start::kSvd:
      if (views.size() >= 3) {
        const SvdFit fit = FitSvd(graph.camera, views);
        if (unconstrained) return fit.quadric;
        try {
          return EllipsoidFromDualQuadric(fit.quadric);
        } catch (const std::invalid_argument&) {
          // no ellipsoid: the sphere instead
        }
      }
      break;
    case Start::kSphere:
      break;
  }
  return InModel(FitSphere(graph.camera, views, prior), options.landmark_model);
}

Summary Grow(const PreparedGraph& prepared,
             const SolveOptions& options,
             const Monitor& monitor,
             State* state) {
  const Graph& graph = prepared.graph;
  std::vector<bool> started(graph.num_objects(), false);
  Summary total;
  for (int begin = 0; begin < graph.num_poses(); begin += options.grow_poses) {
    Stage stage;
    stage.end_pose = std::min(begin + options.grow_poses, graph.num_poses());
    const bool last = stage.end_pose == graph.num_poses();
    DeadReckon(prepared, begin, stage.end_pose, state);
    for (int object = 0; object < graph.num_objects(); ++object) {
      const std::vector<int>& rows = prepared.boxes_of_object[object];
      const auto end = std::partition_point(rows.begin(), rows.end(), [&](int row) {
        return graph.boxes.pose[row] < stage.end_pose;
      });
      const std::vector<int> seen(rows.begin(), end);
      if (!started[object] && (last || static_cast<int>(seen.size()) >= options.grow_min_views)) {
        state->landmarks.row(object) = StartObject(prepared, options, *state, object, seen);
        started[object] = true;
      }
      if (started[object]) stage.boxes.insert(stage.boxes.end(), seen.begin(), seen.end());
    }
    if (stage.boxes.empty()) continue;
    stage.residual =
        options.residual == Residual::kTangentThenBox ? Residual::kTangent : options.residual;
    stage.loss = IsRobust(options.loss) ? Loss::kCauchy : Loss::kNone;
    stage.minimizer = Minimizer::kLevenbergMarquardt;
    stage.max_iterations = options.grow_iterations;
    stage.function_tolerance = options.grow_tolerance;
    Append(Optimize(prepared, options, stage, monitor, state), &total);
  }
  return total;
}

}  // namespace dqslam
