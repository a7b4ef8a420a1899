// All terms of a stage but boxes: odometry, relative positions, priors.
#pragma once

#include "dqslam/costs/odometry.h"
#include "dqslam/costs/relative_position.h"
#include "dqslam/costs/scene_priors.h"
#include "dqslam/costs/size_prior.h"
#include "dqslam/solver/terms.h"

namespace dqslam {

template <typename Pose, typename Landmark, bool kDerivatives>
class OtherTerms : public Terms<Pose, kDerivatives> {
 public:
  using Terms<Pose, kDerivatives>::Terms;

  /// False where one of them is undefined.
  bool Add() { return AddOdometry() && AddPositions() && AddObjects() && AddCameraHeights(); }

 private:
  using Base = Terms<Pose, kDerivatives>;
  using Base::cost_;
  using Base::equations_;
  using Base::graph;
  using Base::kTangent;
  using Base::ObjectAt;
  using Base::ObjectBlock;
  using Base::PoseAt;
  using Base::PoseBlock;
  using Base::stage_;

  bool AddOdometry() {
    const OdometryTable& table = graph().odometry;
    for (const Link& link : stage_.links.odometry) {
      const int from = table.from[link.row], to = table.to[link.row];
      const OdometryCost<Pose> term{
          {},
          table.relative.row(link.row).transpose(),
          Matrix<kTangent, kTangent>(stage_.prepared.odometry_sqrt_information[link.row])};
      Vector<kTangent> residual;
      if constexpr (kDerivatives) {
        using Jet = ceres::Jet<double, 2 * kTangent>;
        Jet a[Pose::kSize], b[Pose::kSize], jets[kTangent];
        PoseJets<Pose>(PoseAt(from), 0, a);
        PoseJets<Pose>(PoseAt(to), kTangent, b);
        term(a, b, jets);
        Matrix<kTangent, 2 * kTangent> J;
        SplitJets(jets, &residual, &J);
        const Matrix<kTangent, kTangent> by_from = J.template leftCols<kTangent>();
        const Matrix<kTangent, kTangent> by_to = J.template rightCols<kTangent>();
        equations_->AddDiagonal(PoseBlock(from), by_from, residual);
        equations_->AddDiagonal(PoseBlock(to), by_to, residual);
        if (from < to) {
          equations_->AddOffDiagonal(link.shared, by_from, by_to);
        } else {
          equations_->AddOffDiagonal(link.shared, by_to, by_from);
        }
      } else {
        term(PoseAt(from), PoseAt(to), residual.data());
      }
      cost_ += 0.5 * residual.squaredNorm();
    }
    return true;
  }

  bool AddPositions() {
    const PositionTable& table = graph().positions;
    for (const Link& link : stage_.links.positions) {
      const RelativePositionCost<Pose, Landmark> term{
          {},
          table.object_in_robot.row(link.row).transpose(),
          stage_.prepared.position_sqrt_information[link.row]};
      const int pose = table.pose[link.row], object = table.object[link.row];
      Vector<3> residual;
      Matrix<3, kTangent> by_pose;
      Matrix<3, kLandmarkSize> by_object;
      this->template Differentiate<3>(term, pose, object, &residual, &by_pose, &by_object);
      cost_ += 0.5 * residual.squaredNorm();
      if constexpr (kDerivatives) {
        equations_->AddDiagonal(PoseBlock(pose), by_pose, residual);
        equations_->AddDiagonal(ObjectBlock(object), by_object, residual);
        equations_->AddOffDiagonal(link.shared, by_pose, by_object);
      }
    }
    return true;
  }

  bool AddObjects() {
    if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
      const SizePriorTable& prior = graph().size_prior;
      const ScenePriors& scene = graph().scene_priors;
      for (const int object : stage_.slots.objects) {
        const double* e = ObjectAt(object);
        const int block = ObjectBlock(object);
        const SizePriorCost size{{}, prior.log_mean[object], prior.log_sigma[object]};
        if (!AddPrior<6>(size, e, block)) return false;
        const UprightCost upright{{}, scene.up, scene.upright_sigma};
        if (scene.upright_sigma > 0 && !AddPrior<3>(upright, e, block)) {
          return false;
        }
        const SupportPlaneCost support{{}, scene.up, scene.plane_offset, scene.support_sigma};
        if (scene.support_sigma > 0 && !AddPrior<1>(support, e, block)) return false;
      }
    }
    return true;
  }

  template <int kResiduals, typename Term>
  bool AddPrior(const Term& term, const double* landmark, int block) {
    Vector<kResiduals> residual;
    if constexpr (kDerivatives) {
      using Jet = ceres::Jet<double, kLandmarkSize>;
      Jet parameters[kLandmarkSize], jets[kResiduals];
      PlainJets<kLandmarkSize>(landmark, 0, parameters);
      if (!term(parameters, jets)) return false;
      Matrix<kResiduals, kLandmarkSize> J;
      SplitJets(jets, &residual, &J);
      equations_->AddDiagonal(block, J, residual);
    } else if (!term(landmark, residual.data())) {
      return false;
    }
    cost_ += 0.5 * residual.squaredNorm();
    return true;
  }

  bool AddCameraHeights() {
    const ScenePriors& scene = graph().scene_priors;
    if (scene.camera_height_sigma == 0) return true;
    const CameraHeightCost<Pose> term{{},
                                      stage_.prepared.mount,
                                      scene.up,
                                      scene.plane_offset,
                                      scene.camera_height,
                                      scene.camera_height_sigma};
    const VariableIndex& layout = stage_.slots;
    for (int pose = layout.first_free_pose; pose < layout.end_pose; ++pose) {
      Vector<1> residual;
      if constexpr (kDerivatives) {
        using Jet = ceres::Jet<double, kTangent>;
        Jet parameters[Pose::kSize], jet;
        PoseJets<Pose>(PoseAt(pose), 0, parameters);
        term(parameters, &jet);
        Matrix<1, kTangent> J;
        SplitJets(&jet, &residual, &J);
        equations_->AddDiagonal(PoseBlock(pose), J, residual);
      } else {
        term(PoseAt(pose), residual.data());
      }
      cost_ += 0.5 * residual.squaredNorm();
    }
    return true;
  }
};

}  // namespace dqslam
