#include "dqslam/solver/assembly.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>

#include "dqslam/costs/algebraic.h"
#include "dqslam/costs/box.h"
#include "dqslam/costs/odometry.h"
#include "dqslam/costs/relative_position.h"
#include "dqslam/costs/scene_priors.h"
#include "dqslam/costs/size_prior.h"
#include "dqslam/costs/tangent.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/geometry/manifolds.h"
#include "dqslam/solver/loss.h"
#include "dqslam/solver/stage_layout.h"

namespace dqslam {
namespace {

template <typename Pose, typename Landmark>
class Assembler {
 public:
  Assembler(const PreparedGraph& prepared,
            const SolveOptions& options,
            const Stage& stage,
            State* state,
            ceres::Problem* problem)
      : prepared_(prepared),
        graph_(prepared.graph),
        options_(options),
        stage_(stage),
        state_(*state),
        problem_(*problem) {}

  void Run() {
    AddPoses();
    AddOdometry();
    std::vector<bool> takes_part(graph_.num_objects(), false);
    for (size_t i = 0; i < stage_.boxes.size(); ++i) {
      const int row = stage_.boxes[i];
      AddBox(row, stage_.weights.empty() ? 1.0 : stage_.weights[i]);
      takes_part[graph_.boxes.object[row]] = true;
    }
    AddPositions(takes_part);
    if (Landmark::kModel == LandmarkModel::kEllipsoid) PrepareEllipsoids(takes_part);
    AddCameraHeight();
  }

 private:
  double* PoseAt(int row) { return state_.poses.row(row).data(); }
  double* LandmarkAt(int row) { return state_.landmarks.row(row).data(); }

  void AddPoses() {
    auto* manifold = new PoseManifold<Pose>;  // the problem owns it, once for all poses
    for (int pose = 0; pose < stage_.end_pose; ++pose) {
      problem_.AddParameterBlock(PoseAt(pose), Pose::kSize, manifold);
      if (pose < stage_.first_free_pose) problem_.SetParameterBlockConstant(PoseAt(pose));
    }
  }

  void AddOdometry() {
    const OdometryTable& odometry = graph_.odometry;
    for (int row = 0; row < odometry.size(); ++row) {
      const int from = odometry.from[row], to = odometry.to[row];
      const bool constant = std::max(from, to) < stage_.first_free_pose;
      if (constant || std::max(from, to) >= stage_.end_pose) continue;
      using Relative = Eigen::Matrix<double, Pose::kSize, 1>;
      using Square = Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>;
      problem_.AddResidualBlock(
          OdometryCost<Pose>::Create(Relative(odometry.relative.row(row).transpose()),
                                     Square(prepared_.odometry_sqrt_information[row])),
          nullptr,
          PoseAt(from),
          PoseAt(to));
    }
  }

  void AddBox(int row, double weight) {
    if (weight == 0) return;
    const int pose = graph_.boxes.pose[row], object = graph_.boxes.object[row];
    if (stage_.loss == Loss::kSwitchable) {
      problem_.AddResidualBlock(
          MakeBoxCost<true>(row), nullptr, PoseAt(pose), LandmarkAt(object), &state_.switches[row]);
      return;
    }
    ceres::LossFunction* loss = MakeLoss(stage_.loss, options_).release();
    if (weight != 1) loss = new ceres::ScaledLoss(loss, weight, ceres::TAKE_OWNERSHIP);
    problem_.AddResidualBlock(MakeBoxCost<false>(row), loss, PoseAt(pose), LandmarkAt(object));
  }

  template <bool kSwitched, typename BoxResidual, typename... Members>
  ceres::CostFunction* Create(const Members&... members) {
    if constexpr (kSwitched) {
      return SwitchedCost<Pose, BoxResidual>::Create(BoxResidual{{}, members...},
                                                     std::sqrt(options_.outlier_chi_square));
    } else {
      return BoxResidual::Create(members...);
    }
  }

  template <bool kSwitched>
  ceres::CostFunction* MakeBoxCost(int row) {
    const Eigen::Vector4d observed = graph_.boxes.box.row(row);
    const Eigen::Matrix4d& weight = prepared_.box_sqrt_information[row];
    const BoxRole role = RoleOfBox(prepared_, options_, stage_, state_, row);
    if (role.IsAlgebraic()) {
      const Eigen::Matrix4d algebraic_weight =
          Eigen::Matrix4d::Identity() / options_.algebraic_sigma;
      return Create<kSwitched, AlgebraicCost<Pose, Landmark>>(
          prepared_.mount,
          BoxLines(graph_.camera, observed),
          algebraic_weight,
          role.residual == Residual::kAlgebraicNormalized);
    }
    if (role.residual == Residual::kBox) {
      return Create<kSwitched, BoxCost<Pose, Landmark>>(
          graph_.camera, prepared_.mount, observed, weight, role.one_sided);
    }
    return Create<kSwitched, TangentCost<Pose, Landmark>>(
        graph_.camera, prepared_.mount, observed, weight, role.depth, role.one_sided);
  }

  void AddPositions(const std::vector<bool>& takes_part) {
    const PositionTable& positions = graph_.positions;
    for (int row = 0; row < positions.size(); ++row) {
      const int pose = positions.pose[row], object = positions.object[row];
      if (pose >= stage_.end_pose || !takes_part[object]) continue;
      problem_.AddResidualBlock(RelativePositionCost<Pose, Landmark>::Create(
                                    Eigen::Vector3d(positions.object_in_robot.row(row)),
                                    prepared_.position_sqrt_information[row]),
                                nullptr,
                                PoseAt(pose),
                                LandmarkAt(object));
    }
  }

  void PrepareEllipsoids(const std::vector<bool>& takes_part) {
    EllipsoidManifold* manifold = nullptr;  // the problem owns it, once for all objects
    for (int object = 0; object < graph_.num_objects(); ++object) {
      if (!takes_part[object]) continue;
      // The prior first: it may be all there is of an object whose boxes have no weight.
      problem_.AddResidualBlock(SizePriorCost::Create(graph_.size_prior.log_mean[object],
                                                      graph_.size_prior.log_sigma[object]),
                                nullptr,
                                LandmarkAt(object));
      if (!manifold) manifold = new EllipsoidManifold;
      problem_.SetManifold(LandmarkAt(object), manifold);
      const ScenePriors& scene = graph_.scene_priors;
      if (scene.upright_sigma > 0) {
        problem_.AddResidualBlock(
            UprightCost::Create(scene.up, scene.upright_sigma), nullptr, LandmarkAt(object));
      }
      if (scene.support_sigma > 0) {
        problem_.AddResidualBlock(
            SupportPlaneCost::Create(scene.up, scene.plane_offset, scene.support_sigma),
            nullptr,
            LandmarkAt(object));
      }
    }
  }

  void AddCameraHeight() {
    const ScenePriors& scene = graph_.scene_priors;
    if (scene.camera_height_sigma == 0) return;
    for (int pose = stage_.first_free_pose; pose < stage_.end_pose; ++pose) {
      problem_.AddResidualBlock(CameraHeightCost<Pose>::Create(prepared_.mount,
                                                               scene.up,
                                                               scene.plane_offset,
                                                               scene.camera_height,
                                                               scene.camera_height_sigma),
                                nullptr,
                                PoseAt(pose));
    }
  }

  const PreparedGraph& prepared_;
  const Graph& graph_;
  const SolveOptions& options_;
  const Stage& stage_;
  State& state_;
  ceres::Problem& problem_;
};

}  // namespace

void Assemble(const PreparedGraph& prepared,
              const SolveOptions& options,
              const Stage& stage,
              State* state,
              ceres::Problem* problem) {
  Dispatch(prepared.graph.pose_model, options.landmark_model, [&](auto pose, auto landmark) {
    Assembler<decltype(pose), decltype(landmark)>(prepared, options, stage, state, problem).Run();
  });
}

}  // namespace dqslam
