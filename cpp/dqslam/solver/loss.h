// Robust losses on whole boxes, in addition to those of Ceres.
//   s    squared norm of a box's residual: chi-square with 4 degrees of freedom for an inlier
//   phi  the chi-square above which a box is doubted
#pragma once

#include <ceres/loss_function.h>

#include <memory>

#include "dqslam/problem/options.h"

namespace dqslam {

/// Dynamic covariance scaling, Agarwal et al. 2013.  Beyond phi the weight is
/// (2 phi / (phi + s))^2, hence rho(s) = 3 phi - 4 phi^2 / (phi + s).
class DcsLoss : public ceres::LossFunction {
 public:
  explicit DcsLoss(double phi) : phi_(phi) {}
  void Evaluate(double s, double rho[3]) const override {
    if (s <= phi_) {
      rho[0] = s;
      rho[1] = 1;
      rho[2] = 0;
      return;
    }
    const double scale = 2 * phi_ / (phi_ + s);
    rho[0] = 3 * phi_ - 2 * phi_ * scale;
    rho[1] = scale * scale;
    rho[2] = -2 * rho[1] / (phi_ + s);
  }

 private:
  double phi_;
};

/// The loss function of a stage, or null for the plain sum of squares.  It is null for switchable
/// constraints and graduated non-convexity too, because they weight the boxes themselves.
inline std::unique_ptr<ceres::LossFunction> MakeLoss(Loss loss, const SolveOptions& options) {
  switch (loss) {
    case Loss::kHuber:
      return std::make_unique<ceres::HuberLoss>(options.loss_scale);
    case Loss::kCauchy:
      return std::make_unique<ceres::CauchyLoss>(options.loss_scale);
    case Loss::kDcs:
      return std::make_unique<DcsLoss>(options.outlier_chi_square);
    case Loss::kNone:
    case Loss::kSwitchable:
    case Loss::kGncTls:
    case Loss::kGncGm:
      break;
  }
  return nullptr;
}

}  // namespace dqslam
