#include "dqslam/online/window.h"

#include <algorithm>
#include <cmath>

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
  const Eigen::Matrix<double, Pose::kTangentSize, 1> zero =
      Eigen::Matrix<double, Pose::kTangentSize, 1>::Zero();
  Pose::FromTangent(zero.data(), identity.data());
  return identity;
}

}  // namespace

template <typename Pose>
WindowResult Window<Pose>::Minimize(History<Pose>* history,
                                    int begin,
                                    MarginalPriors marginal_priors,
                                    int iterations,
                                    double* damping,
                                    Edges edges) {
  WindowResult result;
  edges_ = edges;
  identity_ = Identity<Pose>();
  begin_ = std::max(begin, history->first_pose_is_known ? 1 : 0);
  end_ = history->num_poses();
  if (begin_ >= end_) return result;
  Collect(history, begin_, marginal_priors, &result);
  int uphill = 0;  // steps since the checkpoint
  bool may_climb = true;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const bool possible = LinearizeAll(*history, *damping, &result) && MakeTrial(*history);
    if (possible) FitTrial(*history);
    const double before = uphill > 0 ? saved_.fit.cost : here_.cost;
    if (possible && there_.cost < before) {
      TakeTrial(history);
      *damping = std::max(*damping / 5, kLeastDamping);
      uphill = 0;
      may_climb = true;
      if (before - here_.cost < kTolerance) break;
      continue;
    }
    may_climb = may_climb && possible && std::isfinite(there_.cost) && uphill < kPatience;
    if (may_climb && iteration + 1 < iterations) {
      if (uphill++ == 0) Save(*history);
      TakeTrial(history);
      continue;
    }
    if (uphill > 0) Restore(history);
    uphill = 0;
    *damping = std::min(std::max(*damping, 1e-6) * 10, kMostDamping);
  }
  result.cost = here_.cost;
  result.chi_square = here_.chi_square;
  result.front = chain_.most_objects();
  for (size_t i = 0; i < locals_.size(); ++i) {
    const Local& local = locals_[i];
    local_of_object_[local.object] = -1;
    const bool misfit = local.observations >= kFewestObservations &&
                        here_.of_object[i] > kMisfit * local.observations;
    if (misfit) result.misfits.push_back(local.object);
  }
  return result;
}

template <typename Pose>
void Window<Pose>::Collect(History<Pose>* history,
                           int begin,
                           MarginalPriors marginal_priors,
                           WindowResult* result) {
  locals_.clear();
  local_of_object_.resize(history->objects.size(), -1);
  const int first = history->ObservationsBefore(begin);
  const int last = static_cast<int>(history->observations.size());
  for (int row = first; row < last; ++row) {
    const Observation& observation = history->observations[row];
    if (observation.Waits()) continue;
    int& local = local_of_object_[observation.object];
    if (local < 0) {
      local = static_cast<int>(locals_.size());
      locals_.push_back({observation.object, observation.pose, -1, nullptr, 0, Vector9d::Zero()});
    }
    locals_[local].last_pose = observation.pose;
    ++locals_[local].observations;
    result->residuals += observation.is_box ? 4 : 3;
  }
  result->residuals += k * (end_ - begin_);
  depth_.assign(last - first, 0);
  relinearized_.clear();
  relinearized_.reserve(locals_.size());  // no growth: pointers into it
  for (Local& local : locals_) {
    const Object& object = history->objects[local.object];
    local.marginal = &object.marginal;
    if (marginal_priors == MarginalPriors::kKeep) continue;
    relinearized_.emplace_back();
    relinearized_.back().origin = object.center_shape;
    const int count = CountMarginalized(*history, object, begin, 0);
    AddToMarginalPrior(model_, *history, object, 0, count, &relinearized_.back());
    result->linearized += count;
    local.marginal = &relinearized_.back();
  }
  result->poses = end_ - begin_;
  result->objects = static_cast<int>(locals_.size());
}

template <typename Pose>
bool Window<Pose>::LinearizeAll(const History<Pose>& history,
                                double damping,
                                WindowResult* result) {
  chain_.Reset(damping);
  for (Local& local : locals_) local.slot = -1;
  result->undefined = 0;
  here_.cost = here_.chi_square = 0;
  here_.of_object.assign(locals_.size(), 0);
  bool solved = true;
  for (int pose = begin_; pose < end_ && solved; ++pose) {
    const double* from = pose > 0 ? history.poses[pose - 1].data() : identity_.data();
    const LinearStep<Pose> step =
        LinearizeStep<Pose>(history.steps[pose], from, history.poses[pose].data());
    here_.chi_square += step.residual.squaredNorm();
    if (pose == begin_) {  // from a constant pose
      chain_.AddPose(step.by_to.transpose() * step.by_to, step.by_to.transpose() * step.residual);
    } else {
      solved = chain_.NextPose(step.residual, step.by_from, step.by_to) && Leave(pose - 1);
    }
    if (solved) LinearizePose(history, pose, result);
  }
  here_.cost += 0.5 * here_.chi_square;
  return solved && chain_.Finish() && std::isfinite(here_.cost);
}

template <typename Pose>
void Window<Pose>::LinearizePose(const History<Pose>& history, int pose, WindowResult* result) {
  const double* at = history.poses[pose].data();
  if (model_.scene.camera_height_sigma > 0) {
    Eigen::Matrix<double, k, 1> jacobian;
    const double residual = LinearizeHeight<Pose>(model_, at, &jacobian);
    chain_.AddPose(jacobian * jacobian.transpose(), jacobian * residual);
    here_.cost += 0.5 * residual * residual;
  }
  const Station station = Station::At<Pose>(at, model_.mount);
  const int first = history.ObservationsBefore(begin_);
  Linear<Pose> linear;
  for (int row = history.ObservationsBefore(pose); row < history.ObservationsBefore(pose + 1);
       ++row) {
    const Observation& observation = history.observations[row];
    if (observation.Waits()) continue;
    Local& local = locals_[local_of_object_[observation.object]];
    const Object& object = history.objects[observation.object];
    if (local.slot < 0) {
      local.slot = chain_.AddObject(local_of_object_[observation.object]);
      GaussianPrior sum;
      sum.H = local.marginal->H;
      sum.g = GradientOf(*local.marginal, object.center_shape);
      here_.cost += CostOf(*local.marginal, object.center_shape) +
                    AddPriors(model_, object, object.center_shape, &sum);
      chain_.AddObjectInformation(local.slot, sum.H, sum.g);
    }
    ++result->linearized;
    Linearize<Pose>(model_, station, observation, object.center_shape, edges_, &linear);
    depth_[row - first] = linear.depth;
    result->undefined += linear.depth > 0;
    here_.chi_square += 2 * linear.cost;
    here_.of_object[local_of_object_[observation.object]] += linear.chi_square;
    chain_.AddObservation(local.slot, linear.residual, linear.by_pose, linear.by_object);
  }
}

// Eliminates the objects that a pose saw last.
template <typename Pose>
bool Window<Pose>::Leave(int pose) {
  // Objects are in the order of their first observations, not their last: all are looked at, which
  // costs little beside the elimination of the pose.
  for (Local& local : locals_) {
    if (local.last_pose == pose && local.slot >= 0 && !chain_.EliminateObject(local.slot)) {
      return false;
    }
  }
  return true;
}

template <typename Pose>
bool Window<Pose>::MakeTrial(const History<Pose>& history) {
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
        const Vector9d& center_shape = history.objects[local.object].center_shape;
        possible = possible && step.allFinite() && Move(center_shape, step, &local.trial);
      });
  return possible;
}

template <typename Pose>
const double* Window<Pose>::TrialPose(const History<Pose>& history, int pose) const {
  if (pose < 0) return identity_.data();
  return pose < begin_ ? history.poses[pose].data() : trial_[pose - begin_].data();
}

template <typename Pose>
void Window<Pose>::FitTrial(const History<Pose>& history) {
  there_.cost = there_.chi_square = 0;
  there_.of_object.assign(locals_.size(), 0);
  for (const Local& local : locals_) {
    const Object& object = history.objects[local.object];
    there_.cost += CostOf(*local.marginal, local.trial) + CostOfPriors(model_, object, local.trial);
  }
  const int first = history.ObservationsBefore(begin_);
  for (int pose = begin_; pose < end_; ++pose) {
    const double* at = TrialPose(history, pose);
    there_.chi_square +=
        2 * CostOfStep<Pose>(history.steps[pose], TrialPose(history, pose - 1), at);
    if (model_.scene.camera_height_sigma > 0) {
      Eigen::Matrix<double, k, 1> unused;
      there_.cost += 0.5 * std::pow(LinearizeHeight<Pose>(model_, at, &unused), 2);
    }
    const Station station = Station::At<Pose>(at, model_.mount);
    for (int row = history.ObservationsBefore(pose); row < history.ObservationsBefore(pose + 1);
         ++row) {
      const Observation& observation = history.observations[row];
      if (observation.Waits()) continue;
      const int local = local_of_object_[observation.object];
      double chi_square;
      there_.chi_square +=
          2 *
          CostOfObservation<Pose>(
              model_, station, observation, locals_[local].trial, depth_[row - first], &chi_square);
      there_.of_object[local] += chi_square;
      if (!std::isfinite(chi_square)) {
        there_.cost = chi_square;
        return;
      }
    }
  }
  there_.cost += 0.5 * there_.chi_square;
}

template <typename Pose>
void Window<Pose>::TakeTrial(History<Pose>* history) {
  std::copy(trial_.begin(), trial_.end(), history->poses.begin() + begin_);
  for (const Local& local : locals_) history->objects[local.object].center_shape = local.trial;
  std::swap(here_, there_);
}

template <typename Pose>
void Window<Pose>::Save(const History<Pose>& history) {
  saved_.fit = here_;
  saved_.poses.assign(history.poses.begin() + begin_, history.poses.end());
  saved_.center_shapes.clear();
  for (const Local& local : locals_)
    saved_.center_shapes.push_back(history.objects[local.object].center_shape);
}

template <typename Pose>
void Window<Pose>::Restore(History<Pose>* history) {
  here_ = saved_.fit;
  std::copy(saved_.poses.begin(), saved_.poses.end(), history->poses.begin() + begin_);
  for (size_t i = 0; i < locals_.size(); ++i) {
    history->objects[locals_[i].object].center_shape = saved_.center_shapes[i];
  }
}

template class Window<Se2>;
template class Window<Se3>;

}  // namespace dqslam::online
