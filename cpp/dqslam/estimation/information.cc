#include "dqslam/estimation/information.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <stdexcept>

#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/problem/checks.h"
#include "dqslam/solver/linearize.h"

namespace dqslam {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// The damping, relative to the diagonal of H.  It is far below the information of the data.
constexpr double kDamping = 1e-12;

Stage StageOfInliers(const SolveContext& context, const State& state) {
  Stage stage = BatchStage(context);
  if (IsRobust(context.options.loss)) {
    const std::vector<bool> inliers = InlierBoxes(context, state);
    stage.weights.assign(inliers.begin(), inliers.end());
    stage.loss = Loss::kNone;
  }
  return stage;
}

// A visitor that writes the Jacobian of each term as a group of rows.
template <typename Pose, typename Landmark>
class JacobianRows {
 public:
  JacobianRows(const SolveContext& context, const VariableIndex& variables, const State& state)
      : context_(context), variables_(variables), state_(state) {}

  template <typename Cost, typename... Rows>
  bool Visit(const Cost& cost, const Rows&... rows) {
    Matrix<Cost::kResidualSize, 1> residual;
    Matrix<Cost::kResidualSize, (kTangentOf<Pose, Rows> + ...)> jacobian;
    if (!Differentiate(cost, &residual, &jacobian, ParametersOf(rows)...)) return false;
    Add(residual, jacobian, rows...);
    return true;
  }

  bool VisitBox(const StageBox& box) {
    const PoseRow pose{context_.graph().boxes.pose[box.row]};
    const ObjectRow object{context_.graph().boxes.object[box.row]};
    if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
      if (!IsAlgebraic(box.residual.residual)) {
        const double* values = ValuesOf(object);
        return box.shape == Shape::kEllipsoid
                   ? AddEdges(box, Unpacked<EllipsoidModel>(values), pose, object)
                   : AddEdges(
                         box, Unpacked<BodyModel>(RoundedModel(box.shape), values), pose, object);
      }
      return Visit(MakeAlgebraicCost<Pose, Landmark>(context_, box), pose, object);
    } else {
      return VisitBoxCost<Pose, Landmark>(
          context_, box, [&](const auto& cost) { return Visit(cost, pose, object); });
    }
  }

  void MoveTo(Information* information) {
    const int rows = static_cast<int>(residuals_.size());
    information->residuals = Eigen::Map<const Eigen::VectorXd>(residuals_.data(), rows);
    starts_.push_back(static_cast<int>(columns_.size()));
    information->jacobian =
        Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(rows,
                                                                       variables_.num_tangents(),
                                                                       starts_.back(),
                                                                       starts_.data(),
                                                                       columns_.data(),
                                                                       values_.data());
  }

 private:
  const double* ValuesOf(PoseRow pose) const { return state_.poses.row(pose.row).data(); }
  const double* ValuesOf(ObjectRow object) const { return state_.landmarks.row(object.row).data(); }
  const double* ValuesOf(SharedRow shared) const { return state_.SharedAt(shared.row); }
  template <typename Row>
  auto ParametersOf(Row row) const {
    return dqslam::ParametersOf<Pose>(row, ValuesOf(row));
  }

  // Boxes and tangents, differentiated by hand.
  template <typename Model>
  bool AddEdges(const StageBox& box,
                const Unpacked<Model>& landmark,
                PoseRow pose,
                ObjectRow object) {
    Matrix<kBoxSize, 1> residual;
    Matrix<kBoxSize, Pose::kTangentSize> by_pose;
    Matrix<kBoxSize, kLandmarkSize> by_object;
    const Station station = Station::At<Pose>(ValuesOf(pose), context_.prepared.mount);
    if (!LinearizeBox<Pose, true>(
            context_.prepared, box, station, landmark, &residual, &by_pose, &by_object)) {
      return false;
    }
    Matrix<kBoxSize, Pose::kTangentSize + kLandmarkSize> jacobian;
    jacobian << by_pose, by_object;
    Add(residual, jacobian, pose, object);
    return true;
  }

  // Columns within a row must ascend, but odometry from a later to an earlier pose has the later
  // one first.
  template <int m, int kColumns, typename... Rows>
  void Add(const Matrix<m, 1>& residual, const Matrix<m, kColumns>& jacobian, const Rows&... rows) {
    struct Block {
      int column, first, size;
    };
    int first = 0;
    std::array<Block, sizeof...(Rows)> blocks{
        Block{variables_.Tangent(rows),
              (first += kTangentOf<Pose, Rows>)-kTangentOf<Pose, Rows>,
              kTangentOf<Pose, Rows>}...};
    std::sort(blocks.begin(), blocks.end(), [](const Block& a, const Block& b) {
      return a.column < b.column;
    });
    for (int i = 0; i < m; ++i) {
      residuals_.push_back(residual[i]);
      starts_.push_back(static_cast<int>(columns_.size()));
      for (const Block& block : blocks) {
        if (block.column < 0) continue;  // constant
        for (int c = 0; c < block.size; ++c) {
          columns_.push_back(block.column + c);
          values_.push_back(jacobian(i, block.first + c));
        }
      }
    }
  }

  const SolveContext& context_;
  const VariableIndex& variables_;
  const State& state_;
  std::vector<double> residuals_, values_;
  std::vector<int> starts_, columns_;
};

}  // namespace

int Information::PoseColumn(int pose) const {
  return block_sizes.empty() ? 0 : (pose - first_free_pose) * block_sizes.front();
}

int Information::ObjectColumn(int object) const {
  const auto begin = block_sizes.begin();
  return std::accumulate(begin, begin + num_free_poses, 0) + object * kLandmarkSize;
}

StageTerms InformationTerms(const Graph& graph, const SolveOptions& options, const State& state) {
  const PreparedGraph prepared(graph, options.mode == Mode::kMapping);
  const Monitor no_monitor;
  const SolveContext context{prepared, options, no_monitor};
  return SelectTerms(context, StageOfInliers(context, state), state);
}

Information ComputeInformation(const Graph& graph,
                               const SolveOptions& options,
                               const State& state) {
  const PreparedGraph prepared(graph, options.mode == Mode::kMapping);
  CheckState("state", graph, state);
  const Monitor no_monitor;
  const SolveContext context{prepared, options, no_monitor};
  const StageTerms terms = SelectTerms(context, StageOfInliers(context, state), state);

  Information information;
  information.first_free_pose = terms.variables.first_free_pose;
  information.num_free_poses = terms.variables.num_free_poses();
  information.num_boxes = static_cast<int>(terms.boxes.size());
  information.block_sizes = terms.variables.BlockSizes();
  const bool defined =
      Dispatch(graph.pose_model, options.landmark_model, [&](auto pose, auto landmark) {
        JacobianRows<decltype(pose), decltype(landmark)> rows(context, terms.variables, state);
        if (!VisitTerms<decltype(pose), decltype(landmark)>(prepared, terms, &rows)) return false;
        rows.MoveTo(&information);
        return true;
      });
  if (!defined) throw std::runtime_error("covariance: a residual is undefined at this state");
  information.matrix = Sparse(information.jacobian.transpose()) * information.jacobian;
  return information;
}

// Every entry of a block of J^T J must be stored, also where it is zero.
Sparse Damped(const Sparse& H) {
  Sparse damping(H.rows(), H.cols());
  damping.setIdentity();
  for (int i = 0; i < H.rows(); ++i) {
    damping.coeffRef(i, i) = std::max(kDamping * H.coeff(i, i), 1e-300);
  }
  return H + damping;
}

}  // namespace dqslam
