// What a caller of a session may choose.  Every default lives here and nowhere else.
#pragma once

namespace dqslam::online {

struct OnlineOptions {
  int window_poses = 10;           ///< minimized at every step
  int window_iterations = 1;       ///< Levenberg-Marquardt steps of the window
  int recent_poses = 64;           ///< minimized now and then,
  int recent_every = 16;           ///< each so many steps
  int lap_poses = 640;             ///< minimized rarely,
  int lap_every = 128;             ///< each so many steps, sooner while a session is young
  int smoothing_iterations = 5;    ///< Levenberg-Marquardt steps of these two
  int tour_poses = 2048;           ///< minimized by one such step,
  int tour_every = 512;            ///< each so many steps
  int loop_absence = 128;          ///< poses without a observation before an object closes a loop
  double loop_chi_square = 2.0;    ///< of the window, per residual: the loop does not fit
  int loop_iterations = 10;        ///< Levenberg-Marquardt steps over a loop
  double misfit_chi_square = 3.0;  ///< of the window, per residual: its objects start again
  int recover_every = 8;           ///< steps between two such starts, at least
  double loss_scale = 0.0;         ///< of a Cauchy loss on boxes, sigmas of a box; 0: least squares
};

}  // namespace dqslam::online
