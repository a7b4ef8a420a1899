#include "dqslam/online/schedule.h"

#include <algorithm>

namespace dqslam::online {
namespace {

constexpr double kLapObjects = 40;  // in the front of a lap of full length, at most
// A young session minimizes a lap whenever it has grown by this share, after so many steps.
constexpr int kLapGrowth = 4, kSoonestLap = 16;
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
  if (end >= std::max(next_lap_, kSoonestLap)) {
    next_lap_ = end + std::clamp(end / kLapGrowth, kSoonestLap, options_.lap_every);
    const int lap = Shortened(options_.lap_poses), tour = Shortened(options_.tour_poses);
    if (end < std::max(next_tour_, options_.tour_every) || tour <= lap) {
      return {last(lap), options_.smoothing_iterations};
    }
    next_tour_ = end + options_.tour_every;
    return {last(tour), 1, 1};
  }
  if (end % options_.recent_every == 0) {
    return {last(options_.recent_poses), options_.smoothing_iterations};
  }
  return {window.begin};
}

bool Schedule::ClosesLoop(const WindowFit& window) {
  loop_credit_ = std::min(loop_credit_ + 1.0 / options_.lap_every, kMostCredit);
  const bool is_near = loop_until_ >= window.end - 1;
  const bool fits = !loop_misfits_ && window.chi_square <= options_.loop_chi_square;
  if (!is_near || fits || loop_credit_ < 1) return false;
  loop_credit_ -= 1;
  loop_until_ = -1;
  loop_misfits_ = false;
  return true;
}

void Schedule::SmoothedWith(int poses, int objects_in_front) {
  if (poses > options_.recent_poses) lap_objects_ = objects_in_front;
}

int Schedule::Shortened(int poses) const {
  const double square = lap_objects_ * lap_objects_ / (kLapObjects * kLapObjects);
  const int fewer = static_cast<int>(poses / std::max(square, 1.0));
  return std::max(fewer, std::min(options_.recent_poses, poses));
}

}  // namespace dqslam::online
