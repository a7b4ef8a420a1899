// Base of every cost: the functor's type carries its sizes, and Create() is inherited.
#pragma once

#include <ceres/autodiff_cost_function.h>

#include <utility>

namespace dqslam {

template <typename Functor, int kResidualSize, int... kBlockSizes>
struct AutoDiffCost {
  /// A Ceres cost function around Functor{members...}, in their order.  The caller owns it.
  template <typename... Members>
  static ceres::CostFunction* Create(const Members&... members) {
    return new ceres::AutoDiffCostFunction<Functor, kResidualSize, kBlockSizes...>(
        new Functor{{}, members...});
  }
};

}  // namespace dqslam
