#include "dqslam/estimation/information.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/problem/checks.h"
#include "dqslam/solver/linearize.h"

namespace dqslam {
namespace {

using RowMajorSparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;
using RowMajorBlock = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

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
    information->jacobian = Eigen::Map<const RowMajorSparse>(rows,
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

// Rows of the Jacobian that follow each other and have the same columns, which are whole blocks.
struct RowGroup {
  int begin, end;
  std::vector<int> blocks;
};

std::vector<RowGroup> GroupRows(const RowMajorSparse& J, const std::vector<int>& block_sizes) {
  std::vector<int> block_of_column;
  for (size_t block = 0; block < block_sizes.size(); ++block) {
    block_of_column.insert(block_of_column.end(), block_sizes[block], static_cast<int>(block));
  }
  std::vector<RowGroup> groups;
  for (int row = 0; row < J.rows(); ++row) {
    std::vector<int> blocks;
    for (int p = J.outerIndexPtr()[row]; p < J.outerIndexPtr()[row + 1];) {
      blocks.push_back(block_of_column[J.innerIndexPtr()[p]]);
      p += block_sizes[blocks.back()];
    }
    if (groups.empty() || groups.back().blocks != blocks) {
      groups.push_back({row, row, std::move(blocks)});
    }
    groups.back().end = row + 1;
  }
  return groups;
}

// J^T J, group by group.
BlockMatrix NormalMatrix(const RowMajorSparse& J, const std::vector<int>& block_sizes) {
  const std::vector<RowGroup> groups = GroupRows(J, block_sizes);
  std::vector<std::pair<int, int>> coupled;
  for (const RowGroup& group : groups) {
    for (size_t b = 1; b < group.blocks.size(); ++b) {
      for (size_t a = 0; a < b; ++a) coupled.emplace_back(group.blocks[a], group.blocks[b]);
    }
  }
  BlockMatrix H(block_sizes, coupled);
  size_t pair = 0;
  for (const RowGroup& group : groups) {
    const int first = J.outerIndexPtr()[group.begin];
    const int columns = J.outerIndexPtr()[group.begin + 1] - first;
    const Eigen::Map<const RowMajorBlock> rows(
        J.valuePtr() + first, group.end - group.begin, columns);
    const auto add = [&](double* block, int at_a, int size_a, int at_b, int size_b) {
      Eigen::Map<Eigen::MatrixXd>(block, size_a, size_b).noalias() +=
          rows.middleCols(at_a, size_a).transpose().lazyProduct(rows.middleCols(at_b, size_b));
    };
    int at_b = 0;
    for (const int b : group.blocks) {
      add(H.Diagonal(b), at_b, H.size(b), at_b, H.size(b));
      int at_a = 0;
      for (size_t k = 0; group.blocks[k] != b; ++k) {
        const int a = group.blocks[k];
        add(H.OffDiagonal(H.index_of_pair(pair++)), at_a, H.size(a), at_b, H.size(b));
        at_a += H.size(a);
      }
      at_b += H.size(b);
    }
  }
  return H;
}

}  // namespace

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
  const bool defined =
      Dispatch(graph.pose_model, options.landmark_model, [&](auto pose, auto landmark) {
        JacobianRows<decltype(pose), decltype(landmark)> rows(context, terms.variables, state);
        if (!VisitTerms<decltype(pose), decltype(landmark)>(prepared, terms, &rows)) return false;
        rows.MoveTo(&information);
        return true;
      });
  if (!defined) throw std::runtime_error("covariance: a residual is undefined at this state");
  information.H = NormalMatrix(information.jacobian, terms.variables.BlockSizes());
  return information;
}

BlockCholesky Factorize(const BlockMatrix& H) {
  BlockCholesky cholesky(H);
  if (!cholesky.Factorize(H, (kDamping * H.diagonal()).cwiseMax(1e-300))) {
    throw std::runtime_error("the information matrix is not positive definite");
  }
  return cholesky;
}

}  // namespace dqslam
