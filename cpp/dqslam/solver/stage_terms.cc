#include "dqslam/solver/stage_terms.h"

#include <algorithm>

#include "dqslam/geometry/outline.h"
#include "dqslam/linear/parallel.h"
#include "dqslam/solver/visit_object.h"

namespace dqslam {
namespace {

VariableIndex IndexVariables(const Graph& graph, const Stage& stage) {
  VariableIndex variables;
  variables.pose_size = graph.pose_size();
  variables.tangent_size = graph.tangent_size();
  variables.first_free_pose = stage.first_free_pose;
  variables.first_pose = std::min(stage.first_free_pose, stage.end_pose);
  variables.end_pose = stage.end_pose;
  variables.num_shared = graph.num_shared();
  variables.moves_shared = stage.moves_shared;
  variables.slot_of_object.assign(graph.num_objects(), -1);
  for (const int row : stage.boxes) {
    variables.slot_of_object[graph.boxes.object[row]] = 0;
    variables.first_pose = std::min(variables.first_pose, graph.boxes.pose[row]);
  }
  for (int object = 0; object < graph.num_objects(); ++object) {
    if (variables.slot_of_object[object] < 0) continue;
    variables.slot_of_object[object] = variables.num_objects();
    variables.objects.push_back(object);
  }
  return variables;
}

BoxResidual ChooseResidual(const SolveContext& context,
                           const Stage& stage,
                           const State& state,
                           int row) {
  BoxResidual chosen;
  chosen.residual = stage.residual;
  if (IsAlgebraic(stage.residual)) return chosen;
  const BoxTable& boxes = context.graph().boxes;
  const CameraInWorld<double> camera = LocateCamera(context.prepared, state, boxes.pose[row]);
  VisitObject(context.options, state, boxes.object[row], [&](const auto& in_world) {
    const auto in_camera = ToCamera(camera, in_world);
    chosen.one_sided = boxes.truncated.row(row);
    Eigen::Vector4d predicted;
    if (ProjectToBox(in_camera, context.graph().camera, &predicted)) {
      chosen.one_sided =
          OneSidedEdges(chosen.one_sided, context.graph().camera, in_camera, predicted);
      if (stage.residual == Residual::kBox) return;
    }
    chosen.residual = Residual::kTangent;
    chosen.depth = TangentDepth(in_camera);
  });
  return chosen;
}

}  // namespace

StageTerms SelectTerms(const SolveContext& context, const Stage& stage, const State& state) {
  const Graph& graph = context.graph();
  StageTerms terms{IndexVariables(graph, stage), state.shapes, {}, {}, {}};
  VariableIndex& variables = terms.variables;
  // Where no pose is free, no odometry is in the stage.
  const int odometry = variables.num_free_poses() > 0 ? graph.odometry.size() : 0;
  for (int row = 0; row < odometry; ++row) {
    const auto [earlier, later] = std::minmax(graph.odometry.from[row], graph.odometry.to[row]);
    if (later < stage.first_free_pose || later >= stage.end_pose) continue;
    variables.first_pose = std::min<int>(variables.first_pose, earlier);
    terms.odometry.push_back(row);
  }
  terms.boxes.reserve(stage.boxes.size());
  for (size_t i = 0; i < stage.boxes.size(); ++i) {
    const int row = stage.boxes[i];
    const double weight = stage.weights.empty() ? 1.0 : stage.weights[i];
    if (weight == 0) continue;
    terms.boxes.push_back({row, weight, {}, ShapeOf(state.shapes, graph.boxes.object[row])});
  }
  const auto choose = [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    for (std::ptrdiff_t i = begin; i < end; ++i) {
      StageBox& box = terms.boxes[i];
      box.residual = ChooseResidual(context, stage, state, box.row);
    }
  };
  const auto num_boxes = static_cast<std::ptrdiff_t>(terms.boxes.size());
  ParallelForParts(context.options.threads, num_boxes, kBoxesPerPart, choose);
  for (const MeasurementTable& table : graph.measurements) {
    std::vector<int>& rows = terms.measurements.emplace_back();
    for (int row = 0; row < table.size(); ++row) {
      const int pose = table.pose[row];
      if (pose >= stage.end_pose || variables.slot_of_object[table.object[row]] < 0) continue;
      variables.first_pose = std::min(variables.first_pose, pose);
      rows.push_back(row);
    }
  }
  return terms;
}

}  // namespace dqslam
