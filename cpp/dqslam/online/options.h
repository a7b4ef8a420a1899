// What a caller of a session may choose.  Every default lives here and nowhere else.
#pragma once

namespace dqslam::online {

/// A level of smoothing: how many of the last poses are minimized together, how often, and how far.
struct SmoothingLevel {
  int poses;       ///< How many of the last poses are minimized.
  int every;       ///< How many steps lie between two smoothings of this level.
  int iterations;  ///< How many Levenberg-Marquardt steps a smoothing takes.
};

struct OnlineOptions {
  /// How many of the last poses are minimized at every step.
  int window_poses = 10;
  /// How many Levenberg-Marquardt steps the window takes at every step.
  int window_iterations = 1;
  /// The level that repairs what the window froze too early.
  SmoothingLevel short_smoothing{64, 16, 5};
  /// The level that follows the growth of a young session, and smooths more often while it is
  /// young.
  SmoothingLevel medium_smoothing{640, 128, 5};
  /// The level that takes the place of a medium one when it is due.
  SmoothingLevel long_smoothing{2048, 512, 1};
  /// An object closes a loop when it is seen again after more than this many poses.
  int loop_absence = 128;
  /// A loop does not fit when the window's chi-square per residual is above this.
  double loop_chi_square = 2.0;
  /// How many Levenberg-Marquardt steps a loop that does not fit takes.
  int loop_iterations = 10;
  /// The last poses and their objects start again when the window's chi-square per residual is
  /// above this.
  double misfit_chi_square = 3.0;
  /// How many steps lie at least between two such starts.
  int recover_every = 8;
  /// The scale of a Cauchy loss on whole boxes, in sigmas; 0 stands for least squares.
  double loss_scale = 0.0;
};

}  // namespace dqslam::online
