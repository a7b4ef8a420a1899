// An object of a state, as the geometry sees it.
#pragma once

#include "dqslam/geometry/body.h"
#include "dqslam/problem/graph.h"
#include "dqslam/problem/options.h"

namespace dqslam {

/// Calls visit with an object in the world, which is a Surface<double> or a Body<double>, and
/// returns the result of the call.
template <typename Visit>
auto VisitObject(const SolveOptions& options, const State& state, int object, Visit&& visit) {
  const double* parameters = state.landmarks.row(object).data();
  const Shape shape = ShapeOf(state.shapes, object);
  if (shape != Shape::kEllipsoid) return visit(RoundedModel(shape).Unpack(parameters));
  return visit(options.landmark_model == LandmarkModel::kEllipsoid
                   ? EllipsoidModel::Unpack(parameters)
                   : DualQuadricModel::Unpack(parameters));
}

}  // namespace dqslam
