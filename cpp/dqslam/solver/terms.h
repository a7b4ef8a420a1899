// What all terms of a stage need while one pass goes over them: where their blocks stand, the cost
// so far and, with derivatives, the normal equations.
#pragma once

#include "dqslam/geometry/jets.h"
#include "dqslam/linear/normal_equations.h"
#include "dqslam/solver/packed_stage.h"

namespace dqslam {

template <int kSize>
using Vector = Eigen::Matrix<double, kSize, 1>;
template <int kRows, int kColumns>
using Matrix = Eigen::Matrix<double, kRows, kColumns>;

template <typename Pose, bool kDerivatives>
class Terms {
 public:
  /// `equations` is null without derivatives. All arguments must outlive this.
  Terms(const PackedStage<Pose>& stage, const Eigen::VectorXd& values, Accumulator* equations)
      : stage_(stage), values_(values), equations_(equations) {}

  /// Of the terms that were added.
  double cost() const { return cost_; }

 protected:
  static constexpr int kTangent = Pose::kTangentSize;

  const Graph& graph() const { return stage_.prepared.graph; }
  const double* PoseAt(int pose) const { return &values_[stage_.PoseStart(pose)]; }
  const double* ObjectAt(int object) const {
    return &values_[stage_.ObjectStart(stage_.slots.slot_of_object[object])];
  }
  int PoseBlock(int pose) const { return stage_.slots.PoseBlock(pose); }
  int ObjectBlock(int object) const { return stage_.slots.ObjectBlock(object); }

  // A cost of a pose and a landmark.
  template <int kResiduals, typename Term>
  bool Differentiate(const Term& term,
                     int pose,
                     int object,
                     Vector<kResiduals>* residual,
                     Matrix<kResiduals, kTangent>* by_pose,
                     Matrix<kResiduals, kLandmarkSize>* by_object) const {
    if constexpr (kDerivatives) {
      using Jet = ceres::Jet<double, kTangent + kLandmarkSize>;
      Jet a[Pose::kSize], b[kLandmarkSize], jets[kResiduals];
      PoseJets<Pose>(PoseAt(pose), 0, a);
      PlainJets<kLandmarkSize>(ObjectAt(object), kTangent, b);
      if (!term(a, b, jets)) return false;
      Matrix<kResiduals, kTangent + kLandmarkSize> J;
      SplitJets(jets, residual, &J);
      *by_pose = J.template leftCols<kTangent>();
      *by_object = J.template rightCols<kLandmarkSize>();
      return true;
    } else {
      return term(PoseAt(pose), ObjectAt(object), residual->data());
    }
  }

  const PackedStage<Pose>& stage_;
  const Eigen::VectorXd& values_;
  Accumulator* equations_;
  double cost_ = 0;
};

}  // namespace dqslam
