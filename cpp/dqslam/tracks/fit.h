// The least-squares estimate of a track under one hypothesis, and its evidence.
#pragma once

#include <optional>

#include "dqslam/tracks/equations.h"

namespace dqslam::tracks {

struct TrackFit {
  Trajectory trajectory;
  Equations equations;  ///< at the estimate
  /// Log of the marginal likelihood, by Laplace's method, up to what all hypotheses share.
  double log_evidence;
  bool converged;
};

/// Minimizes from a start by Levenberg-Marquardt; none where a box is undefined at the start.
/// `moves` (n - 1) is whether the thing moves between two images: the hypothesis.  Throws
/// std::invalid_argument as RequireFit() does.
std::optional<TrackFit> FitTrack(const TrackProblem& problem,
                                 const Trajectory& start,
                                 const Mask& moves,
                                 int max_iterations);

}  // namespace dqslam::tracks
