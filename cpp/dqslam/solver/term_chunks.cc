#include "dqslam/solver/term_chunks.h"

#include <algorithm>

namespace dqslam {
namespace {

// About a millisecond of work, in comparison with which a thread starts quickly.
constexpr size_t kChunk = 4096;

}  // namespace

std::vector<TermChunk> SplitTerms(const Graph& graph, StageTerms* terms) {
  const VariableIndex& variables = terms->variables;
  std::vector<int>& odometry = terms->odometry;
  std::vector<StageBox>& boxes = terms->boxes;
  if (odometry.size() + boxes.size() <= kChunk) {
    return {{variables.first_pose, variables.end_pose, terms->all_odometry(), terms->all_boxes()}};
  }
  const auto later = [&](int row) {
    return std::max(graph.odometry.from[row], graph.odometry.to[row]);
  };
  const auto pose_of = [&](const StageBox& box) { return graph.boxes.pose[box.row]; };
  std::stable_sort(
      odometry.begin(), odometry.end(), [&](int a, int b) { return later(a) < later(b); });
  const auto is_earlier = [&](const StageBox& a, const StageBox& b) {
    return pose_of(a) < pose_of(b);
  };
  if (!std::is_sorted(boxes.begin(), boxes.end(), is_earlier)) {
    std::stable_sort(boxes.begin(), boxes.end(), is_earlier);
  }
  std::vector<TermChunk> chunks;
  TermChunk chunk{variables.first_pose, variables.first_pose, {0, 0}, {0, 0}};
  while (chunk.end_pose < variables.end_pose) {
    const int pose = chunk.end_pose++;
    size_t& next_odometry = chunk.odometry.end;
    while (next_odometry < odometry.size() && later(odometry[next_odometry]) == pose)
      ++next_odometry;
    size_t& next_box = chunk.boxes.end;
    while (next_box < boxes.size() && pose_of(boxes[next_box]) == pose) ++next_box;
    const bool is_full = chunk.odometry.size() + chunk.boxes.size() >= kChunk;
    if (!is_full && chunk.end_pose < variables.end_pose) continue;
    chunks.push_back(chunk);
    chunk = {chunk.end_pose, chunk.end_pose, {next_odometry, next_odometry}, {next_box, next_box}};
  }
  return chunks;
}

}  // namespace dqslam
