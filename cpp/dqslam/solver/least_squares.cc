#include "dqslam/solver/least_squares.h"

#include <cmath>
#include <memory>
#include <utility>

#include "dqslam/geometry/dispatch.h"
#include "dqslam/solver/box_terms.h"
#include "dqslam/solver/loss.h"
#include "dqslam/solver/other_terms.h"
#include "dqslam/solver/packed_stage.h"
#include "dqslam/solver/retraction.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

template <typename Pose, typename Landmark>
class StageProblem : public LeastSquares {
 public:
  StageProblem(const PreparedGraph& prepared,
               const SolveOptions& options,
               const Stage& stage,
               StageLayout layout)
      : LeastSquares(std::move(layout.H)),
        loss_(MakeLoss(stage.loss, options)),
        stage_{prepared, options, loss_.get(), std::move(layout.slots), std::move(layout.links)} {}

  VectorXd Pack(const State& state) const override { return stage_.Pack(state); }
  void Unpack(const VectorXd& values, State* state) const override { stage_.Unpack(values, state); }

  bool Plus(const VectorXd& values, const VectorXd& step, VectorXd* moved) const override {
    return Retract<Pose, Landmark>(stage_, values, step, moved);
  }
  bool RetractAlongPath(const VectorXd& values,
                        const VectorXd& step,
                        VectorXd* moved) const override {
    return dqslam::RetractAlongPath<Pose, Landmark>(stage_, values, step, moved);
  }

  bool Cost(const VectorXd& values, double* cost) const override {
    return Visit<false>(values, nullptr, cost);
  }

  bool Linearize(const VectorXd& values) override {
    equations_.H.SetZero();
    equations_.gradient.setZero(equations_.H.rows());
    Accumulator accumulator(&equations_);
    return Visit<true>(values, &accumulator, &equations_.cost);
  }

 private:
  // One pass over all terms; false where one is undefined.
  template <bool kDerivatives>
  bool Visit(const VectorXd& values, Accumulator* equations, double* cost) const {
    OtherTerms<Pose, Landmark, kDerivatives> others(stage_, values, equations);
    BoxTerms<Pose, Landmark, kDerivatives> boxes(stage_, values, equations);
    const bool defined = others.Add() && boxes.Add();
    *cost = others.cost() + boxes.cost();
    return defined && std::isfinite(*cost);
  }

  const std::unique_ptr<ceres::LossFunction> loss_;
  PackedStage<Pose> stage_;
};

}  // namespace

std::unique_ptr<LeastSquares> MakeLeastSquares(const PreparedGraph& prepared,
                                               const SolveOptions& options,
                                               const Stage& stage,
                                               const State& state) {
  StageLayout layout = MakeStageLayout(prepared, options, stage, state);
  return Dispatch(prepared.graph.pose_model,
                  options.landmark_model,
                  [&](auto pose, auto landmark) -> std::unique_ptr<LeastSquares> {
                    return std::make_unique<StageProblem<decltype(pose), decltype(landmark)>>(
                        prepared, options, stage, std::move(layout));
                  });
}

}  // namespace dqslam
