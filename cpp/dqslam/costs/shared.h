// Priors of several objects that have an unknown number s in common.
//
//   SharedPriorCost    r = s / sigma
//   SharedMedianCost   A prior on sizes whose median is unknown: that of size_prior.h or
//                      body_priors.h, with log_mean + s in place of log_mean.
//
// Blocks: shared [1]; object [9], shared [1].  Residuals: [1], as the prior's, in sigmas.
// The second fails where its prior does.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/costs/body_priors.h"
#include "dqslam/costs/size_prior.h"

namespace dqslam {

struct SharedPriorCost : AutoDiffCost<SharedPriorCost, 1, 1> {
  double sigma;

  template <typename T>
  bool operator()(const T* shared, T* residual) const {
    residual[0] = shared[0] / T(sigma);
    return true;
  }
};

template <typename Cost>
inline constexpr bool kIsSizePrior =
    std::is_same_v<Cost, SizePriorCost> || std::is_same_v<Cost, BodySizeCost>;

template <typename SizePrior>
struct SharedMedianCost
    : AutoDiffCost<SharedMedianCost<SizePrior>, SizePrior::kResidualSize, kLandmarkSize, 1> {
  SizePrior prior;

  template <typename T>
  bool operator()(const T* object, const T* shared, T* residual) const {
    if (!prior(object, residual)) return false;
    // The first three residuals are those of the semi-axes, or of the half-lengths.
    for (int i = 0; i < 3; ++i) residual[i] -= shared[0] / T(prior.log_sigma);
    return true;
  }
};

}  // namespace dqslam
