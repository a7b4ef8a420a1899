#include "dqslam/estimation/grow.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dqslam/estimation/realign.h"
#include "dqslam/estimation/start_object.h"
#include "dqslam/linear/parallel.h"

namespace dqslam {
namespace {

constexpr int kWindow = 128;  // poses before the new ones that a minimization moves as well
// The share of new boxes that the map must explain, and how many of them are needed to tell.
constexpr double kMostUnexplained = 0.2;
constexpr int kFewestBoxes = 6;

class Growth {
 public:
  Growth(const SolveContext& context, State* state)
      : context_(context),
        graph_(context.graph()),
        state_(*state),
        depth_(MedianDepth()),
        started_(graph_.num_objects(), false) {}

  Summary Run() {
    for (int begin = 0, end = 0; begin < graph_.num_poses(); begin = end) {
      end = EndOfPart(begin);
      Add(begin, end);
    }
    return total_;
  }

 private:
  // The distance at which objects of the prior size are seen, meters.
  double MedianDepth() const {
    std::vector<double> depths;
    for (int row = 0; row < graph_.boxes.size(); ++row) {
      const auto box = graph_.boxes.box.row(row);
      const double side =
          std::sqrt((box[2] - box[0]) / graph_.camera.fx * (box[3] - box[1]) / graph_.camera.fy);
      depths.push_back(2 * std::exp(graph_.size_prior.log_mean[graph_.boxes.object[row]]) / side);
    }
    if (depths.empty()) return 1;
    const auto middle = depths.begin() + depths.size() / 2;
    std::nth_element(depths.begin(), middle, depths.end());
    return *middle;
  }

  // The end of the part that begins with a pose: odometry can tell the directions of objects from
  // there, with a sigma of options.grow_angle at most.
  int EndOfPart(int begin) const {
    const OdometryTable& odometry = graph_.odometry;
    const int k = graph_.tangent_size();
    const int translations = graph_.pose_model == PoseModel::kSe2 ? 2 : 3;
    double variance = 0;
    int end = begin + 1;
    for (; end < graph_.num_poses(); ++end) {
      const double* covariance =
          odometry.covariance.row(context_.prepared.odometry_into[end]).data();
      for (int axis = 0; axis < k; ++axis) {
        const double scale = axis < translations ? depth_ * depth_ : 1;
        variance += covariance[axis * k + axis] / scale;
      }
      const bool drifted = variance > context_.options.grow_angle * context_.options.grow_angle;
      if (drifted && end - begin >= context_.options.grow_poses) break;
    }
    return end;
  }

  void Add(int begin, int end) {
    DeadReckon(context_.prepared, begin, end, &state_);
    if (lost_since_ < 0) {
      before_ = state_;
      known_ = started_;
    }
    StartObjects(end);
    const int first_free = std::max(1, begin - kWindow);
    Minimize(first_free, end);
    bool lost = Contradicts(begin, end);
    if (first_free > 1 && (lost || end >= 2 * whole_)) {
      Minimize(1, end);
      lost = Contradicts(begin, end);
    }
    if (first_free <= 1 || lost || end >= 2 * whole_) whole_ = end;
    if (!lost) {
      lost_since_ = -1;
      return;
    }
    if (lost_since_ < 0) lost_since_ = begin;
    if (CloseLoop(end)) lost_since_ = -1;
  }

  void StartObjects(int end) {
    const bool last = end == graph_.num_poses();
    std::vector<int> ready;
    for (int object = 0; object < graph_.num_objects(); ++object) {
      const bool is_seen = CountBefore(object, end) >= context_.options.grow_min_views;
      if (!started_[object] && (last || is_seen)) ready.push_back(object);
    }
    std::vector<Vector9d> starts(ready.size());
    ParallelFor(context_.options.threads, static_cast<int>(ready.size()), [&](int i) {
      starts[i] = StartObject(context_, state_, ready[i], BoxesBefore(ready[i], end));
    });
    for (size_t i = 0; i < ready.size(); ++i) {
      state_.landmarks.row(ready[i]) = starts[i];
      started_[ready[i]] = true;
    }
  }

  int CountBefore(int object, int end) const {
    const std::vector<int>& rows = context_.prepared.boxes_of_object[object];
    const auto behind = std::partition_point(
        rows.begin(), rows.end(), [&](int row) { return graph_.boxes.pose[row] < end; });
    return static_cast<int>(behind - rows.begin());
  }

  std::vector<int> BoxesBefore(int object, int end) const {
    const std::vector<int>& rows = context_.prepared.boxes_of_object[object];
    return {rows.begin(), rows.begin() + CountBefore(object, end)};
  }

  double Minimize(int first_free, int end) {
    Stage stage;
    stage.first_free_pose = first_free;
    stage.end_pose = end;
    for (int object = 0; object < graph_.num_objects(); ++object) {
      if (!started_[object]) continue;
      const std::vector<int>& rows = context_.prepared.boxes_of_object[object];
      const int count = CountBefore(object, end);
      if (count == 0 || graph_.boxes.pose[rows[count - 1]] < first_free) continue;
      stage.boxes.insert(stage.boxes.end(), rows.begin(), rows.begin() + count);
    }
    if (stage.boxes.empty()) return 0;
    stage.residual = context_.options.residual == Residual::kTangentThenBox
                         ? Residual::kTangent
                         : context_.options.residual;
    stage.loss = Loss::kCauchy;
    stage.minimizer = Minimizer::kLevenbergMarquardt;
    stage.max_iterations = context_.options.grow_iterations;
    stage.function_tolerance = context_.options.grow_tolerance;
    const Summary summary = Optimize(context_, stage, &state_);
    Append(summary, &total_);
    return summary.final_cost;
  }

  // Whether many boxes of the new poses show known objects where they are not.
  bool Contradicts(int begin, int end) const {
    if (IsAlgebraic(context_.options.residual)) return false;
    std::vector<int> boxes;
    for (int row = 0; row < graph_.boxes.size(); ++row) {
      const int pose = graph_.boxes.pose[row];
      if (pose >= begin && pose < end && started_[graph_.boxes.object[row]]) boxes.push_back(row);
    }
    const auto count = static_cast<std::ptrdiff_t>(boxes.size());
    if (count < kFewestBoxes) return false;
    const Eigen::ArrayXd chi_squares = 2 * BoxCosts(context_, state_, boxes);
    return (chi_squares > kBoxChiSquare999).count() > kMostUnexplained * count;
  }

  // Moves the poses since which the boxes contradict the map to where the known objects are, if
  // that explains the boxes better.
  bool CloseLoop(int end) {
    const int begin = lost_since_;
    std::vector<int> all, seen_again;
    for (int object = 0; object < graph_.num_objects(); ++object) {
      if (!known_[object]) continue;
      const std::vector<int> before = BoxesBefore(object, begin);
      if (before.empty() || before.size() == BoxesBefore(object, end).size()) continue;
      all.push_back(object);
      if (graph_.boxes.pose[before.back()] < begin - context_.options.grow_poses) {
        seen_again.push_back(object);
      }
    }
    DeadReckon(context_.prepared, begin, end, &before_);
    const State failed = state_;
    const double failed_cost = Minimize(1, end);
    for (const std::vector<int>* known : {&seen_again, &all}) {
      const std::optional<State> realigned = Realign(context_, *known, begin, end, before_);
      if (!realigned) continue;
      state_ = *realigned;
      for (int object = 0; object < graph_.num_objects(); ++object) {
        if (started_[object] && !known_[object]) {
          state_.landmarks.row(object) =
              StartObject(context_, state_, object, BoxesBefore(object, end));
        }
      }
      if (Minimize(1, end) < failed_cost) return true;
    }
    state_ = failed;
    return false;
  }

  const SolveContext& context_;
  const Graph& graph_;
  State& state_;
  const double depth_;
  std::vector<bool> started_;
  int whole_ = 1;            // the end of the poses when all of them were minimized last
  int lost_since_ = -1;      // the first pose of a part that contradicts the map; -1 for none
  State before_;             // the state when that part was added, by dead reckoning
  std::vector<bool> known_;  // the objects that had been started then
  Summary total_;
};

}  // namespace

Summary Grow(const SolveContext& context, State* state) {
  return Growth(context, state).Run();
}

}  // namespace dqslam
