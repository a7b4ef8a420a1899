#include "dqslam/online/window.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "dqslam/costs/measurements.h"
#include "dqslam/online/checkpoint.h"

namespace dqslam::online {
namespace {

constexpr double kLeastDamping = 1e-9, kMostDamping = 1e3;
// Of the cost: a decrease of half is one sigma of what is determined worst.
constexpr double kTolerance = 1e-2;
// Mean chi-square of an object's observations, 4 where all is well, from which on it is in a wrong
// place.
constexpr double kMisfit = 4 * 4;
constexpr int kFewestObservations = 3;
// The watchdog technique: so many steps may cost more, one after the other, before the minimization
// comes back to where it was.  When a loop closes its valley is bent, and the step that is best of
// all leads up its wall: the next ones lead down again, far ahead of where small steps creep.
constexpr int kPatience = 3;

// The pose of no motion: where the prior of a first pose starts from.
template <typename Pose>
typename History<Pose>::Storage Identity() {
  typename History<Pose>::Storage identity;
  const double zero[Pose::kTangentSize] = {};
  Pose::FromTangent(zero, identity.data());
  return identity;
}

}  // namespace

template <typename Pose>
WindowResult Window<Pose>::Minimize(int begin,
                                    MarginalPriors marginal_priors,
                                    int iterations,
                                    double* damping,
                                    EdgeResidual edges) {
  WindowResult result;
  begin_ = std::max(begin, history_.first_pose_is_known ? 1 : 0);
  end_ = history_.num_poses();
  if (begin_ >= end_) return result;
  Collect(marginal_priors, &result);
  std::optional<Checkpoint<Pose>> checkpoint;  // where steps began to go uphill
  Fit fit_of_checkpoint;
  int uphill = 0;  // steps since the checkpoint
  bool may_climb = true;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const bool possible = Linearize(*damping, edges, &result) && MakeTrial();
    if (possible) FitTrial();
    const double before = uphill > 0 ? fit_of_checkpoint.cost : here_.cost;
    if (possible && there_.cost < before) {
      TakeTrial();
      *damping = std::max(*damping / 5, kLeastDamping);
      uphill = 0;
      may_climb = true;
      if (before - here_.cost < kTolerance) break;
      continue;
    }
    may_climb = may_climb && possible && std::isfinite(there_.cost) && uphill < kPatience;
    if (may_climb && iteration + 1 < iterations) {
      if (uphill++ == 0) {
        checkpoint.emplace(history_, begin_);
        fit_of_checkpoint = here_;
      }
      TakeTrial();
      continue;
    }
    if (uphill > 0) {
      checkpoint->Restore(&history_);
      here_ = fit_of_checkpoint;
    }
    uphill = 0;
    *damping = std::min(std::max(*damping, 1e-6) * 10, kMostDamping);
  }
  result.cost = here_.cost;
  result.chi_square = here_.chi_square;
  result.front = chain_.most_objects();
  for (size_t i = 0; i < members_.size(); ++i) {
    const Member& member = members_[i];
    if (marginal_priors == MarginalPriors::kRelinearize)
      history_.objects[member.object].is_stale = true;
    const bool misfit = member.observations >= kFewestObservations &&
                        here_.of_member[i] > kMisfit * member.observations;
    if (misfit) result.misfits.push_back(member.object);
  }
  return result;
}

template <typename Pose>
void Window<Pose>::Collect(MarginalPriors marginal_priors, WindowResult* result) {
  members_.clear();
  seen_.clear();
  std::vector<int> member_of_object(history_.objects.size(), -1);
  for (int row = history_.ObservationsBefore(begin_); row < history_.num_observations(); ++row) {
    const Observation& observation = history_.observations[row];
    if (observation.Waits()) continue;
    int& number = member_of_object[observation.object];
    if (number < 0) {
      number = static_cast<int>(members_.size());
      members_.push_back({observation.object, observation.pose});
    }
    members_[number].last_pose = observation.pose;
    ++members_[number].observations;
    seen_.push_back({&observation, number});
    result->residuals += observation.IsBox() ? kBoxSize : MeasurementSize(observation.kind);
  }
  for (const Member& member : members_) {
    Object& object = history_.objects[member.object];
    object.is_stale = object.is_stale || marginal_priors == MarginalPriors::kRelinearize;
    result->linearized += history_.UpdateMarginalPrior(begin_, &object);
  }
  trial_.assign(end_ - begin_ + 1, begin_ > 0 ? history_.poses[begin_ - 1] : Identity<Pose>());
  result->poses = end_ - begin_;
  result->objects = static_cast<int>(members_.size());
  result->residuals += k * result->poses;
}

template <typename Pose>
bool Window<Pose>::Linearize(double damping, EdgeResidual edges, WindowResult* result) {
  chain_.Reset(damping);
  for (Member& member : members_) member.slot = -1;
  result->undefined = 0;
  here_.cost = here_.chi_square = 0;
  here_.of_member.assign(members_.size(), 0);
  auto seen = seen_.begin();
  for (int pose = begin_; pose < end_; ++pose) {
    const double* from = (pose == begin_ ? trial_[0] : history_.poses[pose - 1]).data();
    const double* at = history_.poses[pose].data();
    const LinearizedStep<Pose> step = LinearizeStep<Pose>(history_.steps[pose], from, at);
    here_.chi_square += step.residual.squaredNorm();
    if (pose == begin_) {  // from a constant pose
      chain_.AddPose(step.by_to.transpose() * step.by_to, step.by_to.transpose() * step.residual);
    } else if (!chain_.NextPose(step.residual, step.by_from, step.by_to) ||
               !EliminateObjectsOf(pose - 1)) {
      return false;
    }
    if (model_.scene.camera_height_sigma > 0) {
      Eigen::Matrix<double, k, 1> jacobian;
      const double residual = LinearizeHeight<Pose>(model_, at, &jacobian);
      chain_.AddPose(jacobian * jacobian.transpose(), jacobian * residual);
      here_.cost += 0.5 * residual * residual;
    }
    const Station station = history_.StationAt(pose);
    for (; seen != seen_.end() && seen->observation->pose == pose; ++seen)
      Linearize(station, edges, &*seen, result);
  }
  here_.cost += 0.5 * here_.chi_square;
  return chain_.Finish() && std::isfinite(here_.cost);
}

template <typename Pose>
void Window<Pose>::Linearize(const Station& station,
                             EdgeResidual edges,
                             Seen* seen,
                             WindowResult* result) {
  Member& member = members_[seen->member];
  const Object& object = history_.objects[member.object];
  if (member.slot < 0) {
    member.slot = chain_.AddObject(seen->member);
    GaussianPrior sum;
    sum.H = object.marginal.H;
    sum.g = object.marginal.GradientAt(object.center_shape);
    here_.cost += object.marginal.CostAt(object.center_shape) +
                  AddPriors(model_, object, object.center_shape, &sum);
    chain_.AddObjectInformation(member.slot, sum.H, sum.g);
  }
  LinearizedObservation<Pose> linear;
  online::Linearize(model_, station, *seen->observation, object.center_shape, edges, &linear);
  chain_.AddObservation(member.slot, linear.residual, linear.by_pose, linear.by_object);
  here_.chi_square += 2 * linear.cost;
  here_.of_member[seen->member] += linear.chi_square;
  seen->depth = linear.depth;
  result->undefined += linear.depth > 0;
  ++result->linearized;
}

// Eliminates the objects that a pose saw last.
template <typename Pose>
bool Window<Pose>::EliminateObjectsOf(int pose) {
  // Objects are in the order of their first observations, not their last: all are looked at, which
  // costs little beside the elimination of the pose.
  for (const Member& member : members_) {
    if (member.last_pose == pose && member.slot >= 0 && !chain_.EliminateObject(member.slot)) {
      return false;
    }
  }
  return true;
}

template <typename Pose>
bool Window<Pose>::MakeTrial() {
  int pose = end_;
  bool possible = true;
  chain_.BackSubstitute(
      [&](const Eigen::Matrix<double, k, 1>& step) {
        --pose;
        trial_[pose - begin_ + 1] = History<Pose>::Retract(history_.poses[pose], step);
        possible = possible && step.allFinite();
      },
      [&](int number, const Vector9d& step) {
        Member& member = members_[number];
        const Vector9d& center_shape = history_.objects[member.object].center_shape;
        possible =
            possible && step.allFinite() && RetractCenterShape(center_shape, step, &member.trial);
      });
  return possible;
}

template <typename Pose>
void Window<Pose>::FitTrial() {
  there_.cost = there_.chi_square = 0;
  there_.of_member.assign(members_.size(), 0);
  for (const Member& member : members_) {
    const Object& object = history_.objects[member.object];
    there_.cost +=
        object.marginal.CostAt(member.trial) + CostOfPriors(model_, object, member.trial);
  }
  auto seen = seen_.begin();
  for (int pose = begin_; pose < end_ && std::isfinite(there_.chi_square); ++pose) {
    const double* from = trial_[pose - begin_].data();
    const double* at = trial_[pose - begin_ + 1].data();
    there_.chi_square += 2 * CostOfStep<Pose>(history_.steps[pose], from, at);
    if (model_.scene.camera_height_sigma > 0) {
      Eigen::Matrix<double, k, 1> unused;
      there_.cost += 0.5 * std::pow(LinearizeHeight<Pose>(model_, at, &unused), 2);
    }
    const Station station = Station::At<Pose>(at, model_.mount);
    for (; seen != seen_.end() && seen->observation->pose == pose; ++seen) {
      const Vector9d& trial = members_[seen->member].trial;
      double chi_square;
      there_.chi_square +=
          2 * CostOfObservation<Pose>(
                  model_, station, *seen->observation, trial, seen->depth, &chi_square);
      there_.of_member[seen->member] += chi_square;
    }
  }
  there_.cost += 0.5 * there_.chi_square;
}

template <typename Pose>
void Window<Pose>::TakeTrial() {
  std::copy(trial_.begin() + 1, trial_.end(), history_.poses.begin() + begin_);
  for (const Member& member : members_) history_.objects[member.object].center_shape = member.trial;
  std::swap(here_, there_);
}

template class Window<Se2>;
template class Window<Se3>;

}  // namespace dqslam::online
