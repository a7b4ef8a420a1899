#include "dqslam/solver/stage_layout.h"

#include <algorithm>

namespace dqslam {
namespace {

VariableIndex MakeSlots(const Graph& graph, const Stage& stage) {
  VariableIndex slots;
  slots.first_free_pose = stage.first_free_pose;
  slots.first_pose = std::min(stage.first_free_pose, stage.end_pose);
  slots.end_pose = stage.end_pose;
  slots.slot_of_object.assign(graph.num_objects(), -1);
  for (const int row : stage.boxes) {
    slots.slot_of_object[graph.boxes.object[row]] = 0;
    slots.first_pose = std::min(slots.first_pose, graph.boxes.pose[row]);
  }
  for (int object = 0; object < graph.num_objects(); ++object) {
    if (slots.slot_of_object[object] < 0) continue;
    slots.slot_of_object[object] = slots.num_objects();
    slots.objects.push_back(object);
  }
  if (stage.loss == Loss::kSwitchable) slots.num_switches = static_cast<int>(stage.boxes.size());
  return slots;
}

// The pairs of blocks that terms couple, in the order of the terms.
class Pairs {
 public:
  int Add(int a, int b) {
    if (a < 0 || b < 0) return -1;
    pairs_.emplace_back(a, b);
    return static_cast<int>(pairs_.size()) - 1;
  }
  const std::vector<std::pair<int, int>>& all() const { return pairs_; }

 private:
  std::vector<std::pair<int, int>> pairs_;
};

void AddOdometry(const Graph& graph, VariableIndex* slots, TermIndex* links, Pairs* pairs) {
  for (int row = 0; row < graph.odometry.size(); ++row) {
    const int from = graph.odometry.from[row], to = graph.odometry.to[row];
    const int earlier = std::min(from, to), later = std::max(from, to);
    if (later < slots->first_free_pose || later >= slots->end_pose) continue;
    slots->first_pose = std::min(slots->first_pose, earlier);
    links->odometry.push_back({row, pairs->Add(slots->PoseBlock(from), slots->PoseBlock(to))});
  }
}

void AddPositions(const Graph& graph, VariableIndex* slots, TermIndex* links, Pairs* pairs) {
  for (int row = 0; row < graph.positions.size(); ++row) {
    const int pose = graph.positions.pose[row], object = graph.positions.object[row];
    if (pose >= slots->end_pose || slots->slot_of_object[object] < 0) continue;
    slots->first_pose = std::min(slots->first_pose, pose);
    links->positions.push_back(
        {row, pairs->Add(slots->PoseBlock(pose), slots->ObjectBlock(object))});
  }
}

std::vector<int> BlockSizes(const Graph& graph, const VariableIndex& slots) {
  std::vector<int> sizes(slots.num_free_poses(), graph.tangent_size());
  sizes.insert(sizes.end(), slots.num_objects(), kLandmarkSize);
  sizes.insert(sizes.end(), slots.num_switches, 1);
  return sizes;
}

Surface<double> UnpackAny(LandmarkModel model, const double* parameters) {
  return model == LandmarkModel::kEllipsoid ? EllipsoidModel::Unpack(parameters)
                                            : DualQuadricModel::Unpack(parameters);
}

}  // namespace

BoxRole RoleOfBox(const PreparedGraph& prepared,
                  const SolveOptions& options,
                  const Stage& stage,
                  const State& state,
                  int box) {
  BoxRole role;
  role.residual = stage.residual;
  if (role.IsAlgebraic()) return role;
  const Graph& graph = prepared.graph;
  const Surface<double> surface = ToCamera(
      LocateCamera(prepared, state, graph.boxes.pose[box]),
      UnpackAny(options.landmark_model, state.landmarks.row(graph.boxes.object[box]).data()));
  role.one_sided = OneSidedEdges(prepared, box, surface);
  Eigen::Vector4d predicted;
  if (role.residual == Residual::kBox && ProjectToBox(surface, graph.camera, &predicted)) {
    return role;
  }
  role.residual = Residual::kTangent;
  role.depth = TangentDepth(surface);
  return role;
}

StageLayout MakeStageLayout(const PreparedGraph& prepared,
                            const SolveOptions& options,
                            const Stage& stage,
                            const State& state) {
  const Graph& graph = prepared.graph;
  VariableIndex slots = MakeSlots(graph, stage);
  TermIndex links;
  Pairs pairs;
  AddOdometry(graph, &slots, &links, &pairs);
  links.boxes.reserve(stage.boxes.size());
  for (size_t i = 0; i < stage.boxes.size(); ++i) {
    const int row = stage.boxes[i];
    const double weight = stage.weights.empty() ? 1.0 : stage.weights[i];
    if (weight == 0) continue;
    const int pose = slots.PoseBlock(graph.boxes.pose[row]);
    const int object = slots.ObjectBlock(graph.boxes.object[row]);
    links.boxes.push_back(
        {{row, pairs.Add(pose, object)}, RoleOfBox(prepared, options, stage, state, row), weight});
    if (slots.num_switches == 0) continue;
    const int on_switch = slots.SwitchBlock(static_cast<int>(links.boxes.size()) - 1);
    links.switches.emplace_back(pairs.Add(pose, on_switch), pairs.Add(object, on_switch));
  }
  slots.num_switches = static_cast<int>(links.switches.size());
  AddPositions(graph, &slots, &links, &pairs);

  StageLayout layout{std::move(slots), std::move(links), {{}, {}}};
  layout.H = BlockMatrix(BlockSizes(graph, layout.slots), pairs.all());
  const auto resolve = [&H = layout.H](int* shared) {
    if (*shared >= 0) *shared = H.index_of_pair(*shared);
  };
  for (Link& link : layout.links.odometry) resolve(&link.shared);
  for (Link& link : layout.links.positions) resolve(&link.shared);
  for (BoxLink& link : layout.links.boxes) resolve(&link.shared);
  for (auto& [with_pose, with_object] : layout.links.switches) {
    resolve(&with_pose);
    resolve(&with_object);
  }
  return layout;
}

}  // namespace dqslam
