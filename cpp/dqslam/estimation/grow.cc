#include "dqslam/estimation/grow.h"

#include <algorithm>

#include "dqslam/estimation/graduated.h"

namespace dqslam {
namespace {

// The end of the range of poses to add at `begin`.  It has options.grow_poses poses, and more as
// long as the sigma of odometry's rotation since `begin` is at most options.grow_rotation.
int EndOfAddition(const SolveContext& context, int begin) {
  const OdometryTable& odometry = context.graph().odometry;
  const int k = context.graph().tangent_size();
  const int rotations = context.graph().pose_model == PoseModel::kSe2 ? 1 : 3;
  double variance = 0;
  int end = begin;
  for (; end < context.graph().num_poses(); ++end) {
    if (end > 0) {
      const double* covariance =
          odometry.covariance.row(context.prepared.odometry_into[end]).data();
      for (int axis = k - rotations; axis < k; ++axis) variance += covariance[axis * k + axis];
    }
    const bool drifted = variance > context.options.grow_rotation * context.options.grow_rotation;
    if (drifted && end - begin >= context.options.grow_poses) break;
  }
  return end;
}

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

Vector9d StartObject(const SolveContext& context,
                     const State& state,
                     int object,
                     const std::vector<int>& boxes) {
  const Graph& graph = context.graph();
  const std::vector<View> views = ViewsOf(context.prepared, state, boxes);
  const SizePrior prior{graph.size_prior.log_mean[object], graph.size_prior.log_sigma[object]};
  const bool unconstrained = context.options.landmark_model == LandmarkModel::kDualQuadric;
  switch (context.options.start) {
    case Start::kIdentity:
      return unconstrained ? IdentityQuadric() : Sphere(Eigen::Vector3d::Zero(), 1);
    case Start::kSizePrior:
      return InModel(BackProject(graph.camera, views, prior), context.options.landmark_model);
    case Start::kSvd:
      if (views.size() >= 3) {
        const SvdFit fit = FitSvd(graph.camera, views);
        if (unconstrained) return fit.quadric;
        try {
          return EllipsoidFromDualQuadric(fit.quadric);
        } catch (const std::invalid_argument&) {
          // The fit is not an ellipsoid: the sphere is used instead.
        }
      }
      break;
    case Start::kSphere:
      break;
  }
  return InModel(FitSphere(graph.camera, views, prior), context.options.landmark_model);
}

Summary Grow(const SolveContext& context, State* state) {
  const Graph& graph = context.graph();
  std::vector<bool> started(graph.num_objects(), false);
  Summary total;
  for (int begin = 0, end = 0; begin < graph.num_poses(); begin = end) {
    end = EndOfAddition(context, begin);
    Stage stage;
    stage.end_pose = end;
    const bool last = end == graph.num_poses();
    DeadReckon(context.prepared, begin, end, state);
    for (int object = 0; object < graph.num_objects(); ++object) {
      const std::vector<int>& rows = context.prepared.boxes_of_object[object];
      const auto behind = std::partition_point(
          rows.begin(), rows.end(), [&](int row) { return graph.boxes.pose[row] < end; });
      const std::vector<int> seen(rows.begin(), behind);
      if (!started[object] &&
          (last || static_cast<int>(seen.size()) >= context.options.grow_min_views)) {
        state->landmarks.row(object) = StartObject(context, *state, object, seen);
        started[object] = true;
      }
      if (started[object]) stage.boxes.insert(stage.boxes.end(), seen.begin(), seen.end());
    }
    if (stage.boxes.empty()) continue;
    stage.residual = context.options.residual == Residual::kTangentThenBox
                         ? Residual::kTangent
                         : context.options.residual;
    stage.loss = IsRobust(context.options.loss) ? Loss::kCauchy : Loss::kNone;
    stage.minimizer = Minimizer::kLevenbergMarquardt;
    stage.max_iterations = context.options.grow_iterations;
    stage.function_tolerance = context.options.grow_tolerance;
    Append(Optimize(context, stage, state), &total);
  }
  return total;
}

}  // namespace dqslam
