// The schedule of smoothings: the poses that are minimized in addition to the window, and when.
#pragma once

#include "dqslam/online/options.h"

namespace dqslam::online {

/// How well a minimization of the window fits.
struct WindowFit {
  int begin = 0, end = 0;  ///< the window has the poses from begin to end - 1
  double chi_square = 0;   ///< per residual; 1 if the model is right
  int undefined = 0;       ///< observations whose objects are not in front
};

/// A smoothing of the poses from `begin` on.  There is none if that is the begin of the window.
struct Smoothing {
  int begin = 0;
  int iterations = 0;
  int rounds = 2;  ///< objects in wrong places are reinitialized between two rounds
  bool closes_loop = false;
};

class Schedule {
 public:
  explicit Schedule(const OnlineOptions& options) : options_(options) {}

  /// Registers an object that is observed from the pose `back` and was last observed from `last`.
  /// Returns whether it closes a loop.  If so, the fit of the window is watched from `now` on.
  bool WatchLoop(int last, int back, int now);
  /// Registers that the watched loop does not fit, whatever the fit of the window is.
  void LoopDoesNotFit() { loop_misfits_ = true; }

  /// Whether the last poses and their young objects must be reinitialized.
  bool Recovers(const WindowFit& window);

  /// Chooses the smoothing of a step.  It is called once per step.
  Smoothing Choose(const WindowFit& window);

 private:
  bool ClosesLoop(const WindowFit& window);

  OnlineOptions options_;
  int loop_begin_ = 0;         // the last pose from which the object was observed before
  int loop_until_ = -1;        // the window is watched for the loop until this pose
  bool loop_misfits_ = false;  // known from late labels, without watching the window
  double loop_credit_ = 1;     // number of loops that may be closed now
  int next_medium_ = 0, next_long_ = 0;
  int next_recovery_ = 0;
};

}  // namespace dqslam::online
