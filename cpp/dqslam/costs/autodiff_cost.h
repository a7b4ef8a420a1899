// Base of every cost: the functor's type carries its sizes, and Create() is inherited.
#pragma once

#include <ceres/autodiff_cost_function.h>

namespace dqslam {

template <typename Functor, int kResiduals, int... kBlockSizes>
struct AutoDiffCost {
  static constexpr int kResidualSize = kResiduals;

  /// A Ceres cost function around Functor{members...}, in their order.  The caller owns it.
  template <typename... Members>
  static ceres::CostFunction* Create(const Members&... members) {
    return CreateFrom(Functor{{}, members...});
  }

  /// The same around a copy of a functor.
  static ceres::CostFunction* CreateFrom(const Functor& functor) {
    return new ceres::AutoDiffCostFunction<Functor, kResiduals, kBlockSizes...>(
        new Functor(functor));
  }
};

}  // namespace dqslam
