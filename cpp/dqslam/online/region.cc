#include "dqslam/online/region.h"

#include <algorithm>
#include <cmath>

namespace dqslam::online {
namespace {

constexpr double kLeastDamping = 1e-9, kMostDamping = 1e3;
// Of the cost: a decrease of half is one sigma of what is determined worst.
constexpr double kTolerance = 1e-2;
// Mean chi-square of an object's sights, 4 where all is well, from which on it is in a wrong place.
constexpr double kMisfit = 4 * 4;
constexpr int kFewestSights = 3;

// The pose of no motion: where the prior of a first pose starts from.
template <typename Pose>
typename History<Pose>::Storage Identity() {
  typename History<Pose>::Storage identity;
  const Eigen::Matrix<double, Pose::kTangentSize, 1> zero =
      Eigen::Matrix<double, Pose::kTangentSize, 1>::Zero();
  Pose::FromTangent(zero.data(), identity.data());
  return identity;
}

}  // namespace

template <typename Pose>
int CountPast(const History<Pose>& history, const Object& object, int pose, int known) {
  const int before = history.SightsBefore(pose);
  const int count = static_cast<int>(object.sights.size());
  while (known < count && object.sights[known] < before) ++known;
  return known;
}

template <typename Pose>
void AddPast(const Model& model,
             const History<Pose>& history,
             const Object& object,
             int first,
             int last,
             Quadratic* past) {
  Linear<Pose> linear;
  const Vector9d d = object.chart - past->origin;
  for (int i = first; i < last; ++i) {
    const Sight& sight = history.sights[object.sights[i]];
    const Station station = Station::At<Pose>(history.poses[sight.pose].data(), model.mount);
    Linearize<Pose>(model, station, sight, object.chart, Edges::kBox, &linear);
    const Matrix9d H = linear.by_object.transpose() * linear.by_object;
    past->H += H;
    past->g += linear.by_object.transpose() * linear.residual - H * d;
  }
}

template <typename Pose>
Work Region<Pose>::Minimize(
    History<Pose>* history, int begin, Past past, int iterations, double* damping, Edges edges) {
  Work work;
  edges_ = edges;
  identity_ = Identity<Pose>();
  begin_ = std::max(begin, history->first_pose_is_known ? 1 : 0);
  end_ = history->num_poses();
  if (begin_ >= end_) return work;
  Collect(history, begin_, past, &work);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    bool solved = false;
    const double before = LinearizeAll(*history, *damping, &solved, &work);
    work.cost = before;
    const bool possible = solved && MakeTrial(*history);
    const double after = possible ? TrialCost(*history, &work) : before;
    if (!(after < before)) {
      *damping = std::min(std::max(*damping, 1e-6) * 10, kMostDamping);
      continue;
    }
    std::copy(trial_.begin(), trial_.end(), history->poses.begin() + begin_);
    for (const Local& local : locals_) history->objects[local.object].chart = local.trial;
    *damping = std::max(*damping / 5, kLeastDamping);
    work.cost = after;
    work.moved = true;
    if (before - after < kTolerance) break;
  }
  work.front = chain_.most_objects();
  for (const Local& local : locals_) {
    local_of_object_[local.object] = -1;
    const bool misfit = local.sights >= kFewestSights && local.chi_square > kMisfit * local.sights;
    if (misfit) work.misfits.push_back(local.object);
  }
  return work;
}

template <typename Pose>
void Region<Pose>::Collect(History<Pose>* history, int begin, Past past, Work* work) {
  locals_.clear();
  local_of_object_.resize(history->objects.size(), -1);
  const int first = history->SightsBefore(begin);
  const int last = static_cast<int>(history->sights.size());
  for (int row = first; row < last; ++row) {
    const Sight& sight = history->sights[row];
    if (sight.Waits()) continue;
    int& local = local_of_object_[sight.object];
    if (local < 0) {
      local = static_cast<int>(locals_.size());
      locals_.push_back({sight.object, sight.pose, -1, nullptr, Vector9d::Zero(), 0, 0});
    }
    locals_[local].last_pose = sight.pose;
  }
  depth_.assign(last - first, 0);
  anew_.clear();
  anew_.reserve(locals_.size());  // no growth: pointers into it
  for (Local& local : locals_) {
    const Object& object = history->objects[local.object];
    local.past = &object.past;
    if (past == Past::kKept) continue;
    anew_.emplace_back();
    anew_.back().origin = object.chart;
    const int count = CountPast(*history, object, begin, 0);
    AddPast(model_, *history, object, 0, count, &anew_.back());
    work->linearized += count;
    local.past = &anew_.back();
  }
  work->poses = end_ - begin_;
  work->objects = static_cast<int>(locals_.size());
}

template <typename Pose>
double Region<Pose>::LinearizeAll(const History<Pose>& history,
                                  double damping,
                                  bool* solved,
                                  Work* work) {
  chain_.Reset(damping);
  for (Local& local : locals_) local.slot = -1;
  work->undefined = 0;
  double cost = 0;
  *solved = true;
  for (int pose = begin_; pose < end_ && *solved; ++pose) {
    const double* from = pose > 0 ? history.poses[pose - 1].data() : identity_.data();
    const LinearStep<Pose> step =
        LinearizeStep<Pose>(history.steps[pose], from, history.poses[pose].data());
    cost += 0.5 * step.residual.squaredNorm();
    if (pose == begin_) {  // from a constant pose
      chain_.AddPose(step.by_to.transpose() * step.by_to, step.by_to.transpose() * step.residual);
    } else {
      *solved = chain_.NextPose(step.residual, step.by_from, step.by_to) && Leave(pose - 1);
    }
    if (*solved) cost += LinearizePose(history, pose, work);
  }
  *solved = *solved && chain_.Finish() && std::isfinite(cost);
  return cost;
}

template <typename Pose>
double Region<Pose>::LinearizePose(const History<Pose>& history, int pose, Work* work) {
  double cost = 0;
  const double* at = history.poses[pose].data();
  if (model_.scene.camera_height_sigma > 0) {
    Eigen::Matrix<double, k, 1> jacobian;
    const double residual = LinearizeHeight<Pose>(model_, at, &jacobian);
    chain_.AddPose(jacobian * jacobian.transpose(), jacobian * residual);
    cost += 0.5 * residual * residual;
  }
  const Station station = Station::At<Pose>(at, model_.mount);
  const int first = history.SightsBefore(begin_);
  Linear<Pose> linear;
  for (int row = history.SightsBefore(pose); row < history.SightsBefore(pose + 1); ++row) {
    const Sight& sight = history.sights[row];
    if (sight.Waits()) continue;
    Local& local = locals_[local_of_object_[sight.object]];
    const Object& object = history.objects[sight.object];
    if (local.slot < 0) {
      local.slot = chain_.AddObject(local_of_object_[sight.object]);
      Quadratic sum;
      sum.H = local.past->H;
      sum.g = GradientOf(*local.past, object.chart);
      cost += CostOf(*local.past, object.chart) + AddPriors(model_, object, object.chart, &sum);
      chain_.AddObjectInformation(local.slot, sum.H, sum.g);
    }
    ++work->linearized;
    Linearize<Pose>(model_, station, sight, object.chart, edges_, &linear);
    depth_[row - first] = linear.depth;
    work->undefined += linear.depth > 0;
    cost += linear.cost;
    chain_.AddSight(local.slot, linear.residual, linear.by_pose, linear.by_object);
  }
  return cost;
}

// Eliminates the objects that a pose saw last.
template <typename Pose>
bool Region<Pose>::Leave(int pose) {
  // Objects are in the order of their first sights, not their last: all are looked at, which costs
  // little beside the elimination of the pose.
  for (Local& local : locals_) {
    if (local.last_pose == pose && local.slot >= 0 && !chain_.EliminateObject(local.slot)) {
      return false;
    }
  }
  return true;
}

template <typename Pose>
bool Region<Pose>::MakeTrial(const History<Pose>& history) {
  trial_.resize(end_ - begin_);
  int pose = end_;
  bool possible = true;
  chain_.BackSubstitute(
      [&](const Eigen::Matrix<double, k, 1>& step) {
        --pose;
        double* moved = trial_[pose - begin_].data();
        Plus<Pose>(history.poses[pose].data(), step.data(), moved);
        Pose::Normalize(moved);
        possible = possible && step.allFinite();
      },
      [&](int name, const Vector9d& step) {
        Local& local = locals_[name];
        const Vector9d& chart = history.objects[local.object].chart;
        possible = possible && step.allFinite() && Move(chart, step, &local.trial);
      });
  return possible;
}

template <typename Pose>
const double* Region<Pose>::TrialPose(const History<Pose>& history, int pose) const {
  if (pose < 0) return identity_.data();
  return pose < begin_ ? history.poses[pose].data() : trial_[pose - begin_].data();
}

template <typename Pose>
double Region<Pose>::TrialCost(const History<Pose>& history, Work* work) {
  double cost = 0;
  for (Local& local : locals_) {
    local.chi_square = local.sights = 0;
    const Object& object = history.objects[local.object];
    cost += CostOf(*local.past, local.trial) + CostOfPriors(model_, object, local.trial);
  }
  const int first = history.SightsBefore(begin_);
  double measured = 0;
  int residuals = 0;
  for (int pose = begin_; pose < end_; ++pose) {
    const double* at = TrialPose(history, pose);
    measured += CostOfStep<Pose>(history.steps[pose], TrialPose(history, pose - 1), at);
    residuals += k;
    if (model_.scene.camera_height_sigma > 0) {
      Eigen::Matrix<double, k, 1> unused;
      cost += 0.5 * std::pow(LinearizeHeight<Pose>(model_, at, &unused), 2);
    }
    const Station station = Station::At<Pose>(at, model_.mount);
    for (int row = history.SightsBefore(pose); row < history.SightsBefore(pose + 1); ++row) {
      const Sight& sight = history.sights[row];
      if (sight.Waits()) continue;
      Local& local = locals_[local_of_object_[sight.object]];
      double chi_square;
      measured +=
          CostOfSight(model_, station, sight, local.trial, depth_[row - first], &chi_square);
      if (!std::isfinite(chi_square)) return chi_square;
      local.chi_square += chi_square;
      ++local.sights;
      residuals += sight.is_box ? 4 : 3;
    }
  }
  work->chi_square = 2 * measured;
  work->residuals = residuals;
  return cost + measured;
}

#define DQSLAM_INSTANTIATE(Pose)                                               \
  template class Region<Pose>;                                                 \
  template int CountPast<Pose>(const History<Pose>&, const Object&, int, int); \
  template void AddPast<Pose>(                                                 \
      const Model&, const History<Pose>&, const Object&, int, int, Quadratic*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
