// The boxes of a stage: nine tenths of all terms.
#pragma once

#include <cmath>
#include <vector>

#include "dqslam/costs/algebraic.h"
#include "dqslam/geometry/box_derivatives.h"
#include "dqslam/solver/loss.h"
#include "dqslam/solver/terms.h"

namespace dqslam {

template <typename Pose, typename Landmark, bool kDerivatives>
class BoxTerms : public Terms<Pose, kDerivatives> {
 public:
  using Terms<Pose, kDerivatives>::Terms;

  /// False where one of them is undefined.
  bool Add() {
    const VariableIndex& layout = stage_.slots;
    stations_.reserve(layout.num_poses());
    for (int pose = layout.first_pose; pose < layout.end_pose; ++pose) {
      stations_.push_back(Station::At<Pose>(PoseAt(pose), stage_.prepared.mount));
    }
    landmarks_.reserve(layout.num_objects());
    for (const int object : layout.objects) landmarks_.emplace_back(ObjectAt(object));
    for (size_t i = 0; i < stage_.links.boxes.size(); ++i) {
      if (!AddBox(i)) return false;
    }
    return true;
  }

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

  bool AddBox(size_t i) {
    const BoxLink& link = stage_.links.boxes[i];
    const BoxTable& table = graph().boxes;
    const int pose = PoseBlock(table.pose[link.row]);
    const int object = ObjectBlock(table.object[link.row]);
    Vector<kBoxSize> residual;
    Matrix<kBoxSize, kTangent> by_pose;
    Matrix<kBoxSize, kLandmarkSize> by_object;
    const bool defined = link.role.IsAlgebraic() ? OfAlgebra(link, &residual, &by_pose, &by_object)
                                                 : OfEdges(link, &residual, &by_pose, &by_object);
    if (!defined) return false;
    if (!stage_.links.switches.empty()) {
      AddSwitched(i, residual, by_pose, by_object);
      return true;
    }
    double rho[3] = {residual.squaredNorm(), 1, 0};
    if (stage_.loss) stage_.loss->Evaluate(rho[0], rho);
    cost_ += 0.5 * link.weight * rho[0];
    if constexpr (kDerivatives) {
      const double scale = link.weight * rho[1];
      if (scale != 1) {
        const double root = std::sqrt(scale);
        residual *= root;
        by_pose *= root;
        by_object *= root;
      }
      equations_->AddDiagonal(pose, by_pose, residual);
      equations_->AddDiagonal(object, by_object, residual);
      equations_->AddOffDiagonal(link.shared, by_pose, by_object);
    }
    return true;
  }

  bool OfEdges(const BoxLink& link,
               Vector<kBoxSize>* residual,
               Matrix<kBoxSize, kTangent>* by_pose,
               Matrix<kBoxSize, kLandmarkSize>* by_object) const {
    const BoxTable& table = graph().boxes;
    const Camera& camera = graph().camera;
    const Station& station = stations_[table.pose[link.row] - stage_.slots.first_pose];
    const Unpacked<Landmark>& landmark =
        landmarks_[stage_.slots.slot_of_object[table.object[link.row]]];
    const Surface<double> surface = ToCamera(station.camera, landmark.surface);
    const Eigen::Vector4d observed = table.box.row(link.row).transpose();
    const bool is_box = link.role.residual == Residual::kBox;
    Eigen::Vector4d error;
    EdgeDerivatives edges;
    if constexpr (kDerivatives) {
      const bool defined = is_box ? DifferentiateBox(surface, camera, &error, &edges)
                                  : DifferentiateTangents(
                                        surface, camera, observed, link.role.depth, &error, &edges);
      if (!defined) return false;
    } else {
      const bool defined =
          is_box ? ProjectToBox(surface, camera, &error)
                 : TangentDistances(surface, camera, observed, link.role.depth, &error);
      if (!defined) return false;
    }
    if (is_box) error -= observed;
    const auto& outward = is_box ? kBoxOutward : kTangentOutward;
    if constexpr (kDerivatives) {
      IgnoreBeyond(link.role.one_sided, outward, &error, &edges);
    } else {
      IgnoreBeyond(link.role.one_sided, &error, outward);
    }
    const Eigen::Matrix4d& whiten = stage_.prepared.box_sqrt_information[link.row];
    residual->noalias() = whiten * error;
    if constexpr (kDerivatives) {
      Matrix<kBoxSize, kTangent> J_pose;
      Matrix<kBoxSize, kLandmarkSize> J_object;
      ByPoseAndLandmark<Pose>(edges, station, stage_.prepared.mount, landmark, &J_pose, &J_object);
      by_pose->noalias() = whiten * J_pose;
      by_object->noalias() = whiten * J_object;
    }
    return true;
  }

  bool OfAlgebra(const BoxLink& link,
                 Vector<kBoxSize>* residual,
                 Matrix<kBoxSize, kTangent>* by_pose,
                 Matrix<kBoxSize, kLandmarkSize>* by_object) const {
    const BoxTable& table = graph().boxes;
    const Eigen::Vector4d observed = table.box.row(link.row).transpose();
    const AlgebraicCost<Pose, Landmark> term{
        {},
        stage_.prepared.mount,
        BoxLines(graph().camera, observed),
        Eigen::Matrix4d::Identity() / stage_.options.algebraic_sigma,
        link.role.residual == Residual::kAlgebraicNormalized};
    return this->template Differentiate<kBoxSize>(
        term, table.pose[link.row], table.object[link.row], residual, by_pose, by_object);
  }

  // r = (w e, (1 - w) sqrt(phi)) as in costs/losses.h.
  void AddSwitched(size_t i,
                   const Vector<kBoxSize>& error,
                   const Matrix<kBoxSize, kTangent>& by_pose,
                   const Matrix<kBoxSize, kLandmarkSize>& by_object) {
    const double w = this->values_[stage_.SwitchStart() + i];
    const double phi = stage_.options.outlier_chi_square;
    const BoxTable& table = graph().boxes;
    const BoxLink& link = stage_.links.boxes[i];
    cost_ += 0.5 * (w * w * error.squaredNorm() + (1 - w) * (1 - w) * phi);
    if constexpr (kDerivatives) {
      const Vector<kBoxSize> residual = w * error;
      const Matrix<kBoxSize, kTangent> J_pose = w * by_pose;
      const Matrix<kBoxSize, kLandmarkSize> J_object = w * by_object;
      const int on_pose = PoseBlock(table.pose[link.row]);
      const int on_object = ObjectBlock(table.object[link.row]);
      const int on_switch = stage_.slots.SwitchBlock(static_cast<int>(i));
      equations_->AddDiagonal(on_pose, J_pose, residual);
      equations_->AddDiagonal(on_object, J_object, residual);
      equations_->AddOffDiagonal(link.shared, J_pose, J_object);
      Vector<kBoxSize + 1> by_switch, all;
      by_switch << error, -std::sqrt(phi);
      all << residual, (1 - w) * std::sqrt(phi);
      equations_->template AddDiagonal<kBoxSize + 1, 1>(on_switch, by_switch, all);
      const auto& [with_pose, with_object] = stage_.links.switches[i];
      equations_->template AddOffDiagonal<kBoxSize, kTangent, 1>(with_pose, J_pose, error);
      equations_->template AddOffDiagonal<kBoxSize, kLandmarkSize, 1>(with_object, J_object, error);
    }
  }

  std::vector<Station> stations_;              // of all poses
  std::vector<Unpacked<Landmark>> landmarks_;  // by slot
};

}  // namespace dqslam
