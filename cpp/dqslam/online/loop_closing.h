// Loops: objects that are observed again after an absence.
//
// Box residuals lead to the right place only from near it.  If the drift of a loop is larger, the
// observations that would close it are deferred, so that they do no harm, until some objects agree
// about the rigid motion that takes the last poses to where the map shows these objects.
#pragma once

#include <optional>
#include <vector>

#include "dqslam/online/options.h"
#include "dqslam/online/window.h"

namespace dqslam::online {

/// Closes the loops of a history, which must outlive it, as its window must.
template <typename Pose>
class LoopClosing {
 public:
  using Square = typename History<Pose>::Square;

  LoopClosing(History<Pose>* history, Window<Pose>* window, const OnlineOptions& options)
      : history_(*history), window_(*window), options_(options) {}

  /// Adds the step to the last pose to the drift.
  void Drift();
  /// Registers that the last pose observes an object of the map from before an absence.
  void Known();

  /// The first pose that is minimized for a loop that begins at a pose.  It is later if the last
  /// poses have been known for long, so that the work is bounded: an object that was not seen for
  /// hours closes no loop of hours then.
  int Begin(int loop_begin) const;

  /// Whether an observation must be deferred: its object comes back after an absence, and is not
  /// where the present pose shows it.
  bool MustWait(const Object& object, const Observation& observation) const;

  /// Minimizes all poses from `begin` on.  If an object does not fit then, nothing changes except
  /// that what the window's poses show after an absence is deferred, and these poses return to
  /// their odometry.
  WindowResult Minimize(int begin, int window_begin);

  /// Whether Minimize() has kept its result.
  static bool IsClosed(const WindowResult& result) {
    return result.undefined == 0 && result.misfits.empty();
  }

  /// Tries to close a loop with deferred observations, if such an attempt is due.  Returns nothing
  /// if none was made or if it failed, and then the history is unchanged.
  std::optional<WindowResult> Realign();

  /// What was learned in the past, for a copy of the history.
  struct Progress {
    Square drift = Square::Zero();  ///< covariance of the last pose, from the last known one on
    size_t deferred = 0;            ///< number of deferred observations at the last attempt
    int next_attempt = 0;           ///< pose
    int wait = 1;                   ///< poses until the attempt after it
    int known = 0;                  ///< the last known pose
    int adrift = 0;                 ///< the known pose before the last absence of all objects
    int found = 0;                  ///< the known pose after it
  };
  const Progress& progress() const { return progress_; }
  void set_progress(const Progress& progress) { progress_ = progress; }

 private:
  using Storage = typename History<Pose>::Storage;

  /// An object with deferred observations.
  struct Return {
    int object;
    int last_view;          ///< the last pose before the absence from which it was observed
    std::vector<int> rows;  ///< of its deferred boxes
  };

  double DriftAngle(const Object& object) const;
  void SettleLaterThan(int begin);
  std::vector<Return> Returns(int first_pose) const;
  std::optional<Storage> FindMotion(const std::vector<Return>& returns,
                                    std::vector<size_t>* agreed) const;
  void Move(const Storage& motion, int anchor, int begin);
  std::vector<int> UseNear(int anchor);

  History<Pose>& history_;
  Window<Pose>& window_;
  OnlineOptions options_;
  Progress progress_;
};

}  // namespace dqslam::online
