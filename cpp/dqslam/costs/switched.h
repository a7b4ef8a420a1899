// Switchable constraints, Suenderhauf & Protzel 2012:  r = (w e, (1 - w) sqrt(phi)), where e is the
// residual of a box and phi is the chi-square above which the box is doubted.
//
// Blocks: those of the box cost, and the switch w [1].  Residual: [5].  Returns false where the box
// cost does.
#pragma once

#include "dqslam/costs/autodiff_cost.h"
#include "dqslam/geometry/blocks.h"

namespace dqslam {

template <typename Pose, typename BoxResidual>
struct SwitchedCost
    : AutoDiffCost<SwitchedCost<Pose, BoxResidual>, kBoxSize + 1, Pose::kSize, kLandmarkSize, 1> {
  BoxResidual box;
  double sqrt_phi;

  template <typename T>
  bool operator()(const T* pose, const T* landmark, const T* w, T* residual) const {
    if (!box(pose, landmark, residual)) return false;
    for (int edge = 0; edge < kBoxSize; ++edge) residual[edge] *= *w;
    residual[kBoxSize] = (T(1) - *w) * T(sqrt_phi);
    return true;
  }
};

}  // namespace dqslam
