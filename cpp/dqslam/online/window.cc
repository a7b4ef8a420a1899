#include "dqslam/online/window.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

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
  Couple();
  std::optional<Checkpoint<Pose>> checkpoint;  // where steps began to go uphill
  Fit fit_of_checkpoint;
  int uphill = 0;  // steps since the checkpoint
  bool may_climb = true, has_moved = true;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    if (has_moved) Linearize(edges, &result);
    has_moved = false;
    const bool possible = MakeTrial(*damping);
    if (possible) FitTrial();
    const double before = uphill > 0 ? fit_of_checkpoint.cost : here_.cost;
    if (possible && there_.cost < before) {
      TakeTrial();
      has_moved = true;
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
      has_moved = true;
      continue;
    }
    if (uphill > 0) {
      checkpoint->Restore(&history_);
      here_ = fit_of_checkpoint;
      has_moved = true;
    }
    uphill = 0;
    *damping = std::min(std::max(*damping, 1e-6) * 10, kMostDamping);
  }
  result.cost = here_.cost;
  result.chi_square = here_.chi_square;
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
    if (!observation.IsUsed()) continue;
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
  trial_.assign(end_ - begin_ + 1,
                begin_ > 0 ? history_.poses[begin_ - 1] : History<Pose>::Identity());
  result->poses = end_ - begin_;
  result->objects = static_cast<int>(members_.size());
  result->residuals += k * result->poses;
}

// Orders the equations, which depends only on what observes what.
template <typename Pose>
void Window<Pose>::Couple() {
  const int poses = end_ - begin_;
  std::vector<int> sizes(poses, k);
  sizes.resize(poses + members_.size(), 9);
  std::vector<std::pair<int, int>> pairs;
  for (int pose = 1; pose < poses; ++pose) pairs.emplace_back(pose - 1, pose);
  for (const Seen& seen : seen_) {
    pairs.emplace_back(seen.observation->pose - begin_, poses + seen.member);
  }
  BlockMatrix H(std::move(sizes), pairs);
  BlockCholesky cholesky(H);
  system_.emplace(System{{0, {}, std::move(H)}, std::move(cholesky)});
}

template <typename Pose>
void Window<Pose>::Linearize(EdgeResidual edges, WindowResult* result) {
  const int poses = end_ - begin_;
  NormalEquations& equations = system_->equations;
  BlockMatrix& H = equations.H;
  H.SetZero();
  equations.gradient = Eigen::VectorXd::Zero(H.rows());
  Accumulator sum(&equations);
  here_.cost = here_.chi_square = 0;
  here_.of_member.assign(members_.size(), 0);
  size_t row = 0;
  for (int pose = 0; pose < poses; ++pose) {
    const double* from = (pose == 0 ? trial_[0] : history_.poses[begin_ + pose - 1]).data();
    const double* at = history_.poses[begin_ + pose].data();
    const LinearizedStep<Pose> step = LinearizeStep<Pose>(history_.steps[begin_ + pose], from, at);
    here_.chi_square += step.residual.squaredNorm();
    sum.AddDiagonal(pose, step.by_to, step.residual);
    if (pose > 0) {  // else it is from a constant pose
      sum.AddDiagonal(pose - 1, step.by_from, step.residual);
      sum.AddOffDiagonal(H.index_of_pair(pose - 1), step.by_from, step.by_to);
    }
    if (model_.scene.camera_height_sigma > 0) {
      Eigen::Matrix<double, k, 1> jacobian;
      const double residual = LinearizeHeight<Pose>(model_, at, &jacobian);
      sum.AddDiagonal(pose,
                      Eigen::Matrix<double, 1, k>(jacobian.transpose()),
                      Eigen::Matrix<double, 1, 1>(residual));
      here_.cost += 0.5 * residual * residual;
    }
    const Station station = history_.StationAt(begin_ + pose);
    for (; row < seen_.size() && seen_[row].observation->pose == begin_ + pose; ++row)
      AddObservation(station, edges, row, &sum);
  }
  for (size_t number = 0; number < members_.size(); ++number) {
    const Object& object = history_.objects[members_[number].object];
    GaussianPrior prior;
    prior.H = object.marginal.H;
    prior.g = object.marginal.GradientAt(object.center_shape);
    here_.cost += object.marginal.CostAt(object.center_shape) +
                  AddPriors(model_, object, object.center_shape, &prior);
    const int block = poses + static_cast<int>(number);
    Eigen::Map<Matrix9d>(H.Diagonal(block)) += prior.H;
    equations.gradient.template segment<9>(H.offset(block)) += prior.g;
  }
  here_.cost += 0.5 * here_.chi_square;
  const auto is_undefined = [](const Seen& seen) { return seen.depth > 0; };
  result->undefined = static_cast<int>(std::count_if(seen_.begin(), seen_.end(), is_undefined));
  result->linearized += static_cast<int>(seen_.size());
}

template <typename Pose>
void Window<Pose>::AddObservation(const Station& station,
                                  EdgeResidual edges,
                                  size_t row,
                                  Accumulator* sum) {
  Seen& seen = seen_[row];
  const Vector9d& center_shape = history_.objects[members_[seen.member].object].center_shape;
  LinearizedObservation<Pose> linear;
  online::Linearize(model_, station, *seen.observation, center_shape, edges, &linear);
  const int poses = end_ - begin_;
  const int pose = seen.observation->pose - begin_;
  sum->AddDiagonal(pose, linear.by_pose, linear.residual);
  sum->AddDiagonal(poses + seen.member, linear.by_object, linear.residual);
  sum->AddOffDiagonal(
      system_->equations.H.index_of_pair(poses - 1 + row), linear.by_pose, linear.by_object);
  here_.chi_square += 2 * linear.cost;
  here_.of_member[seen.member] += linear.chi_square;
  seen.depth = linear.depth;
}

// Takes a damped Gauss-Newton step.  Returns false if there is none.
template <typename Pose>
bool Window<Pose>::MakeTrial(double damping) {
  const NormalEquations& equations = system_->equations;
  if (!std::isfinite(here_.cost) ||
      !system_->cholesky.Factorize(equations.H, damping * equations.H.diagonal())) {
    return false;
  }
  const Eigen::VectorXd step = system_->cholesky.Solve(-equations.gradient);
  if (!step.allFinite()) return false;
  for (int pose = begin_; pose < end_; ++pose) {
    trial_[pose - begin_ + 1] =
        History<Pose>::Retract(history_.poses[pose], step.segment<k>(k * (pose - begin_)));
  }
  const int poses = end_ - begin_;
  bool possible = true;
  for (size_t number = 0; number < members_.size(); ++number) {
    Member& member = members_[number];
    possible = possible && RetractCenterShape(history_.objects[member.object].center_shape,
                                              step.segment<9>(k * poses + 9 * number),
                                              &member.trial);
  }
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

template <typename Pose>
std::optional<typename History<Pose>::Square> Window<Pose>::CovarianceOfLastPose() {
  if (!system_ || begin_ >= end_) return std::nullopt;
  const BlockMatrix& H = system_->equations.H;
  // Without the damping of the last step, which would hide how little is known.
  if (!system_->cholesky.Factorize(H, Eigen::VectorXd::Zero(H.rows()))) return std::nullopt;
  const int offset = k * (end_ - begin_ - 1);
  typename History<Pose>::Square covariance;
  for (int axis = 0; axis < k; ++axis) {
    const Eigen::VectorXd column =
        system_->cholesky.Solve(Eigen::VectorXd::Unit(H.rows(), offset + axis));
    covariance.col(axis) = column.segment<k>(offset);
  }
  if (!covariance.allFinite()) return std::nullopt;
  return 0.5 * (covariance + covariance.transpose());
}

template class Window<Se2>;
template class Window<Se3>;

}  // namespace dqslam::online
