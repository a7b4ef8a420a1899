// Base of every cost: the functor's type carries its sizes, and Create() is inherited.
#pragma once

#include <ceres/autodiff_cost_function.h>

namespace dqslam {

template <typename Functor, int kResiduals, int... kBlockSizes>
struct AutoDiffCost {
  static constexpr int kResidualSize = kResiduals;

  /// Makes a Ceres cost function around Functor{members...}.  The caller owns it.
  template <typename... Members>
  static ceres::CostFunction* Create(const Members&... members) {
    return CreateFrom(Functor{{}, members...});
  }

  /// Makes a Ceres cost function around a copy of a functor.  The caller owns it.
  static ceres::CostFunction* CreateFrom(const Functor& functor) {
    return new ceres::AutoDiffCostFunction<Functor, kResiduals, kBlockSizes...>(
        new Functor(functor));
  }
};

}  // namespace dqslam
