#include "dqslam/online/schedule.h"

#include <algorithm>

namespace dqslam::online {
namespace {

// A young session has a medium smoothing whenever it has grown by this share, after so many steps.
constexpr int kGrowth = 4, kSoonest = 16;
constexpr double kMostCredit = 3;

}  // namespace

bool Schedule::WatchLoop(int last, int back, int now) {
  if (back - last <= options_.loop_absence) return false;
  if (loop_until_ < now) {
    loop_begin_ = last;
    loop_misfits_ = false;
  }
  loop_begin_ = std::min(loop_begin_, last);
  loop_until_ = now + options_.window_poses;
  return true;
}

bool Schedule::Recovers(const WindowFit& window) {
  const bool fits = window.undefined == 0 && window.chi_square <= options_.misfit_chi_square;
  if (fits || window.end < next_recovery_) return false;
  next_recovery_ = window.end + options_.recover_every;
  return true;
}

Smoothing Schedule::Choose(const WindowFit& window) {
  const int end = window.end;
  const auto last = [&](int poses) { return std::min(std::max(end - poses, 0), window.begin); };
  if (ClosesLoop(window)) {
    return {std::min(loop_begin_, window.begin), options_.loop_iterations, 2, true};
  }
  const SmoothingLevel& medium_level = options_.medium_smoothing;
  const SmoothingLevel& long_level = options_.long_smoothing;
  if (end >= std::max(next_medium_, kSoonest)) {
    next_medium_ = end + std::min(std::max(end / kGrowth, kSoonest), medium_level.every);
    if (end < std::max(next_long_, long_level.every)) {
      return {last(medium_level.poses), medium_level.iterations};
    }
    next_long_ = end + long_level.every;
    return {last(long_level.poses), long_level.iterations, 1};
  }
  if (end % options_.short_smoothing.every == 0) {
    return {last(options_.short_smoothing.poses), options_.short_smoothing.iterations};
  }
  return {window.begin};
}

bool Schedule::ClosesLoop(const WindowFit& window) {
  loop_credit_ = std::min(loop_credit_ + 1.0 / options_.medium_smoothing.every, kMostCredit);
  const bool is_near = loop_until_ >= window.end - 1;
  const bool fits = !loop_misfits_ && window.chi_square <= options_.loop_chi_square;
  if (!is_near || fits || loop_credit_ < 1) return false;
  loop_credit_ -= 1;
  loop_until_ = -1;
  loop_misfits_ = false;
  return true;
}

}  // namespace dqslam::online
