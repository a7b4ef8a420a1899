// AutoDiff with respect to tangents, for every cost that has no derivatives by hand: the same
// functors that Ceres differentiates, on jets that move along the tangents of their poses.
#pragma once

#include <ceres/jet.h>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// The parameters of a pose as jets: derivative columns from `column` on are its tangent.
template <typename Pose, int N>
void PoseJets(const double* pose, int column, ceres::Jet<double, N>* jets) {
  using Jet = ceres::Jet<double, N>;
  Jet origin[Pose::kSize], tangent[Pose::kTangentSize];
  for (int i = 0; i < Pose::kSize; ++i) origin[i] = Jet(pose[i]);
  for (int i = 0; i < Pose::kTangentSize; ++i) tangent[i] = Jet(0.0, column + i);
  Plus<Pose>(origin, tangent, jets);
}

/// Parameters that are their own tangent.
template <int kSize, int N>
void PlainJets(const double* values, int column, ceres::Jet<double, N>* jets) {
  for (int i = 0; i < kSize; ++i) jets[i] = ceres::Jet<double, N>(values[i], column + i);
}

/// Splits jets of residuals.
template <int kResiduals, int N>
void SplitJets(const ceres::Jet<double, N>* jets,
               Eigen::Matrix<double, kResiduals, 1>* residual,
               Eigen::Matrix<double, kResiduals, N>* jacobian) {
  for (int i = 0; i < kResiduals; ++i) {
    (*residual)[i] = jets[i].a;
    jacobian->row(i) = jets[i].v.transpose();
  }
}

}  // namespace dqslam
