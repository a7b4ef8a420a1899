#include "dqslam/online/loop_closing.h"

#include <algorithm>
#include <cmath>

#include "dqslam/estimation/bend_path.h"
#include "dqslam/estimation/rigid_consensus.h"
#include "dqslam/online/checkpoint.h"
#include "dqslam/online/initialize_object.h"

namespace dqslam::online {
namespace {

constexpr size_t kMostReturns = 12;  // those with the most boxes; all minimal sets are tried
constexpr size_t kFewestBoxes = 3;   // of each object that agrees: fewer boxes fit anywhere
constexpr int kLongestWait = 64;     // poses between two attempts
constexpr double kDistance = 8;      // from which an object is typically observed, in its radii
// The largest uncertainty of the direction to an object that boxes alone can correct, in radians,
// or in distances beside it.
constexpr double kMostDrift = 4;

}  // namespace

template <typename Pose>
bool LoopClosing<Pose>::MustWait(const Object& object, const Observation& observation) const {
  const auto is_since = [&](int poses, const std::vector<int>& rows) {
    return !rows.empty() && observation.pose - history_.observations[rows.back()].pose <= poses;
  };
  if (is_since(options_.window_poses, object.deferred)) return true;
  if (is_since(options_.loop_absence, object.observations)) return false;
  const bool is_new = object.observations.empty() && object.deferred.empty() && !object.IsOfMap();
  return !is_new && DriftAngle(object) > kMostDrift;
}

template <typename Pose>
void LoopClosing<Pose>::Drift() {
  const auto& step = history_.steps.back();
  Storage back;
  Pose::Between(step.relative.data(), History<Pose>::Identity().data(), back.data());
  const Square turn = Adjoint<Pose>(back.data());
  progress_.drift = turn * progress_.drift * turn.transpose() + step.covariance;
}

template <typename Pose>
void LoopClosing<Pose>::Known() {
  const int pose = history_.num_poses() - 1;
  progress_.drift.setZero();
  if (pose - progress_.known > options_.loop_absence) {
    progress_.adrift = progress_.known;
    progress_.found = pose;
  }
  progress_.known = pose;
}

template <typename Pose>
int LoopClosing<Pose>::Begin(int loop_begin) const {
  const int end = history_.num_poses();
  const int absence = progress_.found - progress_.adrift;
  const bool was_adrift =
      end - progress_.found <= absence || end - progress_.known > options_.loop_absence;
  const int least = end - options_.long_smoothing.poses;
  return std::max(loop_begin, was_adrift ? std::min(progress_.adrift, least) : least);
}

template <typename Pose>
double LoopClosing<Pose>::DriftAngle(const Object& object) const {
  constexpr int rotations = Pose::kModel == PoseModel::kSe2 ? 1 : 3;
  const Surface<double> surface = SurfaceOf(object.center_shape);
  const double radius = std::pow(surface.shape.determinant(), 1.0 / 6);
  const auto variance = progress_.drift.diagonal();
  return std::sqrt(variance.template head<Pose::kTangentSize - rotations>().sum() /
                       std::pow(kDistance * radius, 2) +
                   variance.template tail<rotations>().sum());
}

// Loops of this length may come again.
template <typename Pose>
void LoopClosing<Pose>::SettleLaterThan(int begin) {
  const int length = history_.num_poses() - begin;
  history_.settling = std::max(history_.settling, length + length / 4);
}

template <typename Pose>
WindowResult LoopClosing<Pose>::Minimize(int begin, int window_begin) {
  const Checkpoint<Pose> before(history_, begin);
  SettleLaterThan(begin);
  double damping = kFirstDamping;
  const WindowResult result =
      window_.Minimize(begin, MarginalPriors::kRelinearize, options_.loop_iterations, &damping);
  if (IsClosed(result)) return result;
  before.Restore(&history_);
  history_.DeadReckon(window_begin);
  for (const int object : history_.ObjectsSeenFrom(window_begin)) {
    const std::vector<int>& rows = history_.objects[object].observations;
    const auto pose_of = [&](size_t i) { return history_.observations[rows[i]].pose; };
    size_t first = rows.size() - 1;
    while (first > 0 && pose_of(first) - pose_of(first - 1) <= options_.loop_absence) --first;
    if (first == 0) continue;
    for (const int row : std::vector<int>(rows.begin() + first, rows.end())) history_.Defer(row);
    Object& changed = history_.objects[object];
    changed.center_shape = ObjectProblem(history_, changed).ReinitializeIfBetter();
  }
  return result;
}

template <typename Pose>
std::vector<typename LoopClosing<Pose>::Return> LoopClosing<Pose>::Returns(int first_pose) const {
  std::vector<Return> returns;
  for (int object = 0; object < history_.num_objects(); ++object) {
    const Object& known = history_.objects[object];
    Return one{object, 0, {}};
    for (const int row : known.deferred) {
      const Observation& seen = history_.observations[row];
      if (seen.IsBox() && seen.pose >= first_pose) one.rows.push_back(row);
    }
    if (one.rows.empty()) continue;
    if (!known.observations.empty()) {
      one.last_view = history_.observations[known.observations.back()].pose;
    }
    if (one.last_view < history_.observations[one.rows.front()].pose) returns.push_back(one);
  }
  std::stable_sort(returns.begin(), returns.end(), [](const Return& a, const Return& b) {
    return a.rows.size() > b.rows.size();
  });
  if (returns.size() > kMostReturns) returns.resize(kMostReturns);
  return returns;
}

template <typename Pose>
std::optional<typename LoopClosing<Pose>::Storage> LoopClosing<Pose>::FindMotion(
    const std::vector<Return>& returns, std::vector<size_t>* agreed) const {
  std::vector<PlacePair> pairs;
  for (const Return& one : returns) {
    std::vector<View> views;
    for (const int row : one.rows) {
      const Observation& seen = history_.observations[row];
      views.push_back({history_.StationAt(seen.pose).camera,
                       seen.value,
                       seen.SqrtInformation(),
                       seen.truncated});
    }
    pairs.push_back(PlaceOf(
        history_.model.camera, views, SurfaceOf(history_.objects[one.object].center_shape)));
  }
  return FindRigidMotion<Pose>(pairs, agreed);
}

// Moves the poses from `begin` on by a rigid motion, bends the path from the anchor to there, and
// moves each object with the pose that observed it last.
template <typename Pose>
void LoopClosing<Pose>::Move(const Storage& motion, int anchor, int begin) {
  const std::vector<Storage> before(history_.poses.begin() + anchor, history_.poses.end());
  RowMatrix path(begin - anchor + 1, Pose::kSize);
  std::vector<Square> covariances;
  for (int pose = anchor; pose <= begin; ++pose) {
    path.row(pose - anchor) = history_.poses[pose].transpose();
    if (pose > anchor) covariances.push_back(history_.steps[pose].covariance);
  }
  BendPath<Pose>(covariances, History<Pose>::Compose(motion, history_.poses[begin]), &path);
  for (int pose = anchor; pose < history_.num_poses(); ++pose) {
    history_.poses[pose] = pose <= begin ? Storage(path.row(pose - anchor).transpose())
                                         : History<Pose>::Compose(motion, history_.poses[pose]);
  }
  for (Object& object : history_.objects) {
    if (object.observations.empty()) continue;
    const int viewer = history_.observations[object.observations.back()].pose;
    if (viewer <= anchor) continue;
    object.center_shape = CenterShapeFromSurface(MoveWith<Pose>(before[viewer - anchor].data(),
                                                                history_.poses[viewer].data(),
                                                                SurfaceOf(object.center_shape)));
  }
}

// Uses the deferred observations from poses behind the anchor that are near their objects now.
template <typename Pose>
std::vector<int> LoopClosing<Pose>::UseNear(int anchor) {
  std::vector<int> used;
  for (const Object& object : history_.objects) {
    for (const int row : object.deferred) {
      const Observation& observation = history_.observations[row];
      if (observation.pose <= anchor || history_.IsElsewhere(object, observation)) continue;
      used.push_back(row);
    }
  }
  for (const int row : used) history_.Use(row);
  return used;
}

template <typename Pose>
std::optional<WindowResult> LoopClosing<Pose>::Realign() {
  const int end = history_.num_poses();
  if (history_.num_deferred == progress_.deferred || end < progress_.next_attempt)
    return std::nullopt;
  const int first = end - options_.short_smoothing.poses;
  const std::vector<Return> returns = Returns(first);
  std::vector<size_t> agreed;
  const std::optional<Storage> motion = FindMotion(returns, &agreed);
  progress_.deferred = history_.num_deferred;
  progress_.next_attempt = end + progress_.wait;
  if (!motion || 2 * agreed.size() <= returns.size()) return std::nullopt;
  if (std::any_of(agreed.begin(), agreed.end(), [&](size_t one) {
        return returns[one].rows.size() < kFewestBoxes;
      })) {
    return std::nullopt;
  }
  progress_.wait = std::min(2 * progress_.wait, kLongestWait);
  int anchor = 0, begin = end;
  for (const size_t one : agreed) {
    anchor = std::max(anchor, returns[one].last_view);
    begin = std::min(begin, history_.observations[returns[one].rows.front()].pose);
  }
  if (anchor >= begin) return std::nullopt;
  const Checkpoint<Pose> before(history_, anchor);
  SettleLaterThan(anchor);
  Move(*motion, anchor, begin);
  const std::vector<int> used = UseNear(anchor);
  double damping = kFirstDamping;
  const WindowResult result = window_.Minimize(
      anchor + 1, MarginalPriors::kRelinearize, options_.loop_iterations, &damping);
  const auto fits = [&](size_t one) {
    const std::vector<int>& misfits = result.misfits;
    return std::find(misfits.begin(), misfits.end(), returns[one].object) == misfits.end();
  };
  if (result.undefined == 0 && std::all_of(agreed.begin(), agreed.end(), fits)) {
    progress_.wait = 1;
    return result;
  }
  before.Restore(&history_);
  for (const int row : used) history_.Defer(row);
  progress_.deferred = history_.num_deferred;
  return std::nullopt;
}

template class LoopClosing<Se2>;
template class LoopClosing<Se3>;

}  // namespace dqslam::online
