// Which poses are minimized beside the window's, and when.
#pragma once

#include "dqslam/online/options.h"

namespace dqslam::online {

/// What a minimization of the window says of how well all fits.
struct WindowFit {
  int begin = 0, end = 0;  ///< its poses
  double chi_square = 0;   ///< per residual: 1 where the model is right
  int undefined = 0;       ///< observations whose objects are not in front
};

/// Poses from `begin` on; none where that is the window's begin.
struct Smoothing {
  int begin = 0;
  int iterations = 0;
  int rounds = 2;  ///< objects in a wrong place are started again between two
  bool closes_loop = false;
};

class Schedule {
 public:
  explicit Schedule(const OnlineOptions& options) : options_(options) {}

  /// An object is seen from the pose `back` that was seen last from the pose `last`: returns
  /// whether it closes a loop, for which the window is watched from the pose `now` on.
  bool WatchLoop(int last, int back, int now);
  /// The loop that is watched for does not fit, whatever the window shows.
  void LoopDoesNotFit() { loop_misfits_ = true; }

  /// Whether the last poses and their young objects are to start again.
  bool Recovers(const WindowFit& window);

  /// Called once a step.
  Smoothing Choose(const WindowFit& window);

  /// The work is square in the objects of the front: where there are many, medium and long
  /// smoothings have fewer poses.
  void SmoothedWith(int poses, int objects_in_front);

 private:
  bool ClosesLoop(const WindowFit& window);
  int Shortened(int poses) const;

  OnlineOptions options_;
  int loop_begin_ = 0;         // the pose that last saw what has come back
  int loop_until_ = -1;        // until when the window is watched for it
  bool loop_misfits_ = false;  // known from late labels: no watching is needed
  double loop_credit_ = 1;     // loops that may be closed now
  int next_medium_ = 0, next_long_ = 0;
  int next_recovery_ = 0;
  double front_objects_ = 0;  // of the last smoothing that was longer than a short one
};

}  // namespace dqslam::online
