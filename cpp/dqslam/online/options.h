// The options of a session.  Their defaults are defined here and nowhere else.
#pragma once

namespace dqslam::online {

/// A level of smoothing, which minimizes the last poses together.
struct SmoothingLevel {
  int poses;       ///< Number of the last poses that are minimized.
  int every;       ///< Number of steps between two smoothings of this level.
  int iterations;  ///< Number of Levenberg-Marquardt steps of a smoothing.
};

struct OnlineOptions {
  /// Number of the last poses that are minimized at every step.
  int window_poses = 10;
  /// Number of Levenberg-Marquardt steps of the window at every step.
  int window_iterations = 1;
  /// The level that corrects poses that the window no longer moves.
  SmoothingLevel short_smoothing{64, 16, 5};
  /// The level that smooths more often while the session is young.
  SmoothingLevel medium_smoothing{640, 128, 5};
  /// The level that replaces a medium smoothing when it is due.
  SmoothingLevel long_smoothing{2048, 512, 1};
  /// An object closes a loop if it is observed again after more than this number of poses.
  int loop_absence = 128;
  /// A loop does not fit if the window's chi-square per residual is above this.
  double loop_chi_square = 2.0;
  /// Number of Levenberg-Marquardt steps for a loop that does not fit.
  int loop_iterations = 10;
  /// The last poses and their objects are reinitialized if the window's chi-square per residual is
  /// above this.
  double misfit_chi_square = 3.0;
  /// The least number of steps between two reinitializations.
  int recover_every = 8;
  /// The scale of a Cauchy loss on boxes, in sigmas of a box.  0 means least squares.
  double loss_scale = 0.0;
};

}  // namespace dqslam::online
