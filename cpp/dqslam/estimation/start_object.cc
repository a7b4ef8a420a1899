#include "dqslam/estimation/start_object.h"

#include <algorithm>
#include <stdexcept>

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

Vector9d StartObject(const SolveContext& context,
                     const State& state,
                     int object,
                     const std::vector<int>& boxes) {
  const Graph& graph = context.graph();
  const std::vector<View> views = ViewsOf(context.prepared, state, boxes);
  const SizePrior prior = SizePriorOf(graph, state, object);
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

}  // namespace dqslam
