#include "dqslam/least_squares.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "dqslam/costs/algebraic.h"
#include "dqslam/costs/autodiff.h"
#include "dqslam/costs/losses.h"
#include "dqslam/costs/odometry.h"
#include "dqslam/costs/relative_position.h"
#include "dqslam/costs/scene_priors.h"
#include "dqslam/costs/size_prior.h"
#include "dqslam/dispatch.h"
#include "dqslam/edges.h"
#include "dqslam/manifolds.h"
#include "dqslam/stage_layout.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

template <int kSize>
using Vector = Eigen::Matrix<double, kSize, 1>;
template <int kRows, int kColumns>
using Matrix = Eigen::Matrix<double, kRows, kColumns>;

// Adds what residuals say to normal equations.
class Accumulator {
 public:
  explicit Accumulator(NormalEquations* equations) : equations_(*equations), H_(equations_.H) {}

  template <int kRows, int kColumns>
  void Own(int block, const Matrix<kRows, kColumns>& J, const Vector<kRows>& residual) {
    if (block < 0) return;
    equations_.gradient.segment<kColumns>(H_.offset(block)).noalias() += J.transpose() * residual;
    Eigen::Map<Matrix<kColumns, kColumns>>(H_.Diagonal(block)).noalias() += J.transpose() * J;
  }
  // J_a and J_b in the order of their blocks.
  template <int kRows, int kA, int kB>
  void Shared(int shared, const Matrix<kRows, kA>& J_a, const Matrix<kRows, kB>& J_b) {
    if (shared < 0) return;
    Eigen::Map<Matrix<kA, kB>>(H_.OffDiagonal(shared)).noalias() += J_a.transpose() * J_b;
  }

 private:
  NormalEquations& equations_;
  BlockMatrix& H_;
};

template <typename Pose, typename Landmark>
class StageProblem : public LeastSquares {
 public:
  static constexpr int kTangent = Pose::kTangentSize;

  StageProblem(const PreparedGraph& prepared,
               const SolveOptions& options,
               const Stage& stage,
               StageLayout layout)
      : LeastSquares(std::move(layout.H)),
        prepared_(prepared),
        graph_(prepared.graph),
        options_(options),
        loss_(MakeLoss(stage.loss, options)),
        layout_(std::move(layout.slots)),
        links_(std::move(layout.links)) {}

  VectorXd Pack(const State& state) const override {
    VectorXd values(SwitchStart() + layout_.num_switches);
    for (int pose = layout_.first_pose; pose < layout_.end_pose; ++pose) {
      values.segment<Pose::kSize>(PoseStart(pose)) = state.poses.row(pose).transpose();
    }
    for (int slot = 0; slot < layout_.num_objects(); ++slot) {
      values.segment<kLandmarkSize>(ObjectStart(slot)) =
          state.landmarks.row(layout_.objects[slot]).transpose();
    }
    for (int i = 0; i < layout_.num_switches; ++i) {
      values[SwitchStart() + i] = state.switches[links_.boxes[i].row];
    }
    return values;
  }

  void Unpack(const VectorXd& values, State* state) const override {
    const int first = std::max(layout_.first_pose, layout_.first_free_pose);
    for (int pose = first; pose < layout_.end_pose; ++pose) {
      state->poses.row(pose) = values.segment<Pose::kSize>(PoseStart(pose)).transpose();
    }
    for (int slot = 0; slot < layout_.num_objects(); ++slot) {
      state->landmarks.row(layout_.objects[slot]) =
          values.segment<kLandmarkSize>(ObjectStart(slot)).transpose();
    }
    for (int i = 0; i < layout_.num_switches; ++i) {
      state->switches[links_.boxes[i].row] = values[SwitchStart() + i];
    }
  }

  bool Plus(const VectorXd& values, const VectorXd& step, VectorXd* moved) const override {
    *moved = values;
    const BlockMatrix& H = equations_.H;
    for (int block = 0; block < layout_.num_free_poses(); ++block) {
      const int start = PoseStart(layout_.first_free_pose + block);
      dqslam::Plus<Pose>(&values[start], &step[H.offset(block)], &(*moved)[start]);
      Pose::Normalize(&(*moved)[start]);
    }
    const EllipsoidManifold manifold;
    for (int slot = 0; slot < layout_.num_objects(); ++slot) {
      const int start = ObjectStart(slot);
      const int offset = H.offset(layout_.num_free_poses() + slot);
      if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
        if (!manifold.Plus(&values[start], &step[offset], &(*moved)[start])) return false;
      } else {
        moved->segment<kLandmarkSize>(start) += step.segment<kLandmarkSize>(offset);
      }
    }
    moved->tail(layout_.num_switches) += step.tail(layout_.num_switches);
    return true;
  }

  bool Cost(const VectorXd& values, double* cost) const override {
    Visit<false> visit{*this, values, nullptr};
    const bool defined = visit.All();
    *cost = visit.cost;
    return defined && std::isfinite(*cost);
  }

  bool Linearize(const VectorXd& values) override {
    equations_.H.SetZero();
    equations_.gradient.setZero(equations_.H.rows());
    Accumulator accumulator(&equations_);
    Visit<true> visit{*this, values, &accumulator};
    const bool defined = visit.All();
    equations_.cost = visit.cost;
    return defined && std::isfinite(visit.cost);
  }

 private:
  int PoseStart(int pose) const { return (pose - layout_.first_pose) * Pose::kSize; }
  int ObjectStart(int slot) const {
    return layout_.num_poses() * Pose::kSize + slot * kLandmarkSize;
  }
  int SwitchStart() const { return ObjectStart(layout_.num_objects()); }

  // One pass over all terms at some values: their cost, and with derivatives the equations.
  template <bool kDerivatives>
  struct Visit {
    const StageProblem& problem;
    const VectorXd& values;
    Accumulator* equations;
    double cost = 0;
    std::vector<Station> stations = {};
    std::vector<Unpacked<Landmark>> landmarks = {};

    bool All() { return Odometry() && Boxes() && Positions() && Objects() && CameraHeights(); }

   private:
    const double* PoseAt(int pose) const { return &values[problem.PoseStart(pose)]; }
    const double* ObjectAt(int object) const {
      return &values[problem.ObjectStart(problem.layout_.slot_of_object[object])];
    }
    int PoseBlock(int pose) const { return problem.layout_.PoseBlock(pose); }
    int ObjectBlock(int object) const { return problem.layout_.ObjectBlock(object); }

    bool Odometry() {
      const OdometryTable& table = problem.graph_.odometry;
      for (const Link& link : problem.links_.odometry) {
        const int from = table.from[link.row], to = table.to[link.row];
        const OdometryCost<Pose> term{
            {},
            table.relative.row(link.row).transpose(),
            Matrix<kTangent, kTangent>(problem.prepared_.odometry_sqrt_information[link.row])};
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
          equations->Own(PoseBlock(from), by_from, residual);
          equations->Own(PoseBlock(to), by_to, residual);
          if (from < to) {
            equations->Shared(link.shared, by_from, by_to);
          } else {
            equations->Shared(link.shared, by_to, by_from);
          }
        } else {
          term(PoseAt(from), PoseAt(to), residual.data());
        }
        cost += 0.5 * residual.squaredNorm();
      }
      return true;
    }

    bool Boxes() {
      const Slots& layout = problem.layout_;
      stations.reserve(layout.num_poses());
      for (int pose = layout.first_pose; pose < layout.end_pose; ++pose) {
        stations.push_back(Station::At<Pose>(PoseAt(pose), problem.prepared_.mount));
      }
      landmarks.reserve(layout.num_objects());
      for (const int object : layout.objects) landmarks.emplace_back(ObjectAt(object));
      for (size_t i = 0; i < problem.links_.boxes.size(); ++i) {
        if (!Box(i)) return false;
      }
      return true;
    }

    bool Box(size_t i) {
      const BoxLink& link = problem.links_.boxes[i];
      const BoxTable& table = problem.graph_.boxes;
      const int pose = PoseBlock(table.pose[link.row]);
      const int object = ObjectBlock(table.object[link.row]);
      Vector<kBoxSize> residual;
      Matrix<kBoxSize, kTangent> by_pose;
      Matrix<kBoxSize, kLandmarkSize> by_object;
      const bool defined = link.role.IsAlgebraic()
                               ? Algebraic(link, &residual, &by_pose, &by_object)
                               : Edges(link, &residual, &by_pose, &by_object);
      if (!defined) return false;
      if (!problem.links_.switches.empty()) {
        Switched(i, residual, by_pose, by_object);
        return true;
      }
      double rho[3] = {residual.squaredNorm(), 1, 0};
      if (problem.loss_) problem.loss_->Evaluate(rho[0], rho);
      cost += 0.5 * link.weight * rho[0];
      if constexpr (kDerivatives) {
        const double scale = link.weight * rho[1];
        if (scale != 1) {
          const double root = std::sqrt(scale);
          residual *= root;
          by_pose *= root;
          by_object *= root;
        }
        equations->Own(pose, by_pose, residual);
        equations->Own(object, by_object, residual);
        equations->Shared(link.shared, by_pose, by_object);
      }
      return true;
    }

    bool Edges(const BoxLink& link,
               Vector<kBoxSize>* residual,
               Matrix<kBoxSize, kTangent>* by_pose,
               Matrix<kBoxSize, kLandmarkSize>* by_object) const {
      const BoxTable& table = problem.graph_.boxes;
      const Camera& camera = problem.graph_.camera;
      const Station& station = stations[table.pose[link.row] - problem.layout_.first_pose];
      const Unpacked<Landmark>& landmark =
          landmarks[problem.layout_.slot_of_object[table.object[link.row]]];
      const Surface<double> surface = ToCamera(station.camera, landmark.surface);
      const Eigen::Vector4d observed = table.box.row(link.row).transpose();
      const bool is_box = link.role.residual == Residual::kBox;
      Eigen::Vector4d error;
      EdgeDerivatives edges;
      if constexpr (kDerivatives) {
        const bool defined =
            is_box
                ? DifferentiateBox(surface, camera, &error, &edges)
                : DifferentiateTangents(surface, camera, observed, link.role.depth, &error, &edges);
        if (!defined) return false;
      } else {
        const bool defined =
            is_box ? ProjectToBox(surface, camera, &error)
                   : TangentDistances(surface, camera, observed, link.role.depth, &error);
        if (!defined) return false;
      }
      if (is_box) error -= observed;
      for (int edge = 0; edge < kBoxSize; ++edge) {
        const double outward = is_box && edge < 2 ? -1 : 1;
        if (!link.role.one_sided[edge] || !(outward * error[edge] > 0)) continue;
        error[edge] = 0;
        if constexpr (kDerivatives) edges.by_center[edge] = edges.by_shape[edge] = 0;
      }
      const Eigen::Matrix4d& whiten = problem.prepared_.box_sqrt_information[link.row];
      residual->noalias() = whiten * error;
      if constexpr (kDerivatives) {
        Matrix<kBoxSize, kTangent> J_pose;
        Matrix<kBoxSize, kLandmarkSize> J_object;
        ByPoseAndLandmark<Pose>(
            edges, station, problem.prepared_.mount, landmark, &J_pose, &J_object);
        by_pose->noalias() = whiten * J_pose;
        by_object->noalias() = whiten * J_object;
      }
      return true;
    }

    bool Algebraic(const BoxLink& link,
                   Vector<kBoxSize>* residual,
                   Matrix<kBoxSize, kTangent>* by_pose,
                   Matrix<kBoxSize, kLandmarkSize>* by_object) const {
      const BoxTable& table = problem.graph_.boxes;
      const Eigen::Vector4d observed = table.box.row(link.row).transpose();
      const AlgebraicCost<Pose, Landmark> term{
          {},
          problem.prepared_.mount,
          BoxLines(problem.graph_.camera, observed),
          Eigen::Matrix4d::Identity() / problem.options_.algebraic_sigma,
          link.role.residual == Residual::kAlgebraicNormalized};
      return Differentiate<kBoxSize>(
          term, table.pose[link.row], table.object[link.row], residual, by_pose, by_object);
    }

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

    // r = (w e, (1 - w) sqrt(phi)) as in costs/losses.h.
    void Switched(size_t i,
                  const Vector<kBoxSize>& error,
                  const Matrix<kBoxSize, kTangent>& by_pose,
                  const Matrix<kBoxSize, kLandmarkSize>& by_object) {
      const double w = values[problem.SwitchStart() + i];
      const double phi = problem.options_.outlier_chi_square;
      const BoxTable& table = problem.graph_.boxes;
      const BoxLink& link = problem.links_.boxes[i];
      cost += 0.5 * (w * w * error.squaredNorm() + (1 - w) * (1 - w) * phi);
      if constexpr (kDerivatives) {
        const Vector<kBoxSize> residual = w * error;
        const Matrix<kBoxSize, kTangent> J_pose = w * by_pose;
        const Matrix<kBoxSize, kLandmarkSize> J_object = w * by_object;
        const int on_pose = PoseBlock(table.pose[link.row]);
        const int on_object = ObjectBlock(table.object[link.row]);
        const int on_switch = problem.layout_.SwitchBlock(static_cast<int>(i));
        equations->Own(on_pose, J_pose, residual);
        equations->Own(on_object, J_object, residual);
        equations->Shared(link.shared, J_pose, J_object);
        Vector<kBoxSize + 1> by_switch, all;
        by_switch << error, -std::sqrt(phi);
        all << residual, (1 - w) * std::sqrt(phi);
        equations->Own<kBoxSize + 1, 1>(on_switch, by_switch, all);
        const auto& [with_pose, with_object] = problem.links_.switches[i];
        equations->Shared<kBoxSize, kTangent, 1>(with_pose, J_pose, error);
        equations->Shared<kBoxSize, kLandmarkSize, 1>(with_object, J_object, error);
      }
    }

    bool Positions() {
      const PositionTable& table = problem.graph_.positions;
      for (const Link& link : problem.links_.positions) {
        const RelativePositionCost<Pose, Landmark> term{
            {},
            table.object_in_robot.row(link.row).transpose(),
            problem.prepared_.position_sqrt_information[link.row]};
        const int pose = table.pose[link.row], object = table.object[link.row];
        Vector<3> residual;
        Matrix<3, kTangent> by_pose;
        Matrix<3, kLandmarkSize> by_object;
        Differentiate<3>(term, pose, object, &residual, &by_pose, &by_object);
        cost += 0.5 * residual.squaredNorm();
        if constexpr (kDerivatives) {
          equations->Own(PoseBlock(pose), by_pose, residual);
          equations->Own(ObjectBlock(object), by_object, residual);
          equations->Shared(link.shared, by_pose, by_object);
        }
      }
      return true;
    }

    bool Objects() {
      if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
        const Graph& graph = problem.graph_;
        const ScenePriors& scene = graph.scene_priors;
        for (const int object : problem.layout_.objects) {
          const double* e = ObjectAt(object);
          const int block = ObjectBlock(object);
          const SizePriorCost size{
              {}, graph.size_prior.log_mean[object], graph.size_prior.log_sigma[object]};
          if (!Prior<6>(size, e, block)) return false;
          const UprightCost upright{{}, scene.up, scene.upright_sigma};
          if (scene.upright_sigma > 0 && !Prior<3>(upright, e, block)) {
            return false;
          }
          const SupportPlaneCost support{{}, scene.up, scene.plane_offset, scene.support_sigma};
          if (scene.support_sigma > 0 && !Prior<1>(support, e, block)) return false;
        }
      }
      return true;
    }

    template <int kResiduals, typename Term>
    bool Prior(const Term& term, const double* landmark, int block) {
      Vector<kResiduals> residual;
      if constexpr (kDerivatives) {
        using Jet = ceres::Jet<double, kLandmarkSize>;
        Jet parameters[kLandmarkSize], jets[kResiduals];
        PlainJets<kLandmarkSize>(landmark, 0, parameters);
        if (!term(parameters, jets)) return false;
        Matrix<kResiduals, kLandmarkSize> J;
        SplitJets(jets, &residual, &J);
        equations->Own(block, J, residual);
      } else if (!term(landmark, residual.data())) {
        return false;
      }
      cost += 0.5 * residual.squaredNorm();
      return true;
    }

    bool CameraHeights() {
      const ScenePriors& scene = problem.graph_.scene_priors;
      if (scene.camera_height_sigma == 0) return true;
      const CameraHeightCost<Pose> term{{},
                                        problem.prepared_.mount,
                                        scene.up,
                                        scene.plane_offset,
                                        scene.camera_height,
                                        scene.camera_height_sigma};
      const Slots& layout = problem.layout_;
      for (int pose = layout.first_free_pose; pose < layout.end_pose; ++pose) {
        Vector<1> residual;
        if constexpr (kDerivatives) {
          using Jet = ceres::Jet<double, kTangent>;
          Jet parameters[Pose::kSize], jet;
          PoseJets<Pose>(PoseAt(pose), 0, parameters);
          term(parameters, &jet);
          Matrix<1, kTangent> J;
          SplitJets(&jet, &residual, &J);
          equations->Own(PoseBlock(pose), J, residual);
        } else {
          term(PoseAt(pose), residual.data());
        }
        cost += 0.5 * residual.squaredNorm();
      }
      return true;
    }
  };

  const PreparedGraph& prepared_;
  const Graph& graph_;
  const SolveOptions& options_;
  std::unique_ptr<ceres::LossFunction> loss_;
  Slots layout_;
  Links links_;
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
