#include "dqslam/covariance.h"

#include <ceres/crs_matrix.h>
#include <ceres/problem.h>

#include <cmath>
#include <stdexcept>

#include "dqslam/assembly.h"
#include "dqslam/recover.h"
#include "dqslam/robust.h"
#include "dqslam/selected_inverse.h"

namespace dqslam {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// A variance this many times the one that it would have if all else were known comes from rounding.
constexpr double kUndetermined = 1e9;
// Keeps the factorisation alive on undetermined directions, far below what the data say.
constexpr double kDamping = 1e-12;

// The information matrix: free poses in their order, then all objects.
class Information {
 public:
  Information(const PreparedGraph& prepared, const SolveOptions& options, State state)
      : graph_(prepared.graph), state_(std::move(state)) {
    Stage stage = BatchStage(prepared, options);
    if (IsRobust(options.loss)) {
      const std::vector<bool> inliers = InlierBoxes(prepared, options, state_);
      stage.weights.assign(inliers.begin(), inliers.end());
      stage.loss = Loss::kNone;
    }
    first_free_pose_ = stage.first_free_pose;
    ceres::Problem problem;
    Assemble(prepared, options, stage, &state_, &problem);
    ceres::Problem::EvaluateOptions evaluate;
    for (int pose = first_free_pose_; pose < graph_.num_poses(); ++pose) {
      evaluate.parameter_blocks.push_back(state_.poses.row(pose).data());
      block_sizes.push_back(graph_.tangent_size());
    }
    for (int object = 0; object < graph_.num_objects(); ++object) {
      evaluate.parameter_blocks.push_back(state_.landmarks.row(object).data());
      block_sizes.push_back(kLandmarkSize);
    }
    ceres::CRSMatrix crs;
    double cost = 0;
    if (!problem.Evaluate(evaluate, &cost, nullptr, nullptr, &crs)) {
      throw std::runtime_error("covariance: a residual is undefined at this state");
    }
    const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> J(
        crs.num_rows,
        crs.num_cols,
        static_cast<int>(crs.values.size()),
        crs.rows.data(),
        crs.cols.data(),
        crs.values.data());
    const Sparse column_major = J;
    matrix = Sparse(column_major.transpose()) * column_major;
  }

  int first_free_pose() const { return first_free_pose_; }
  std::string NameOf(int block) const {
    const int poses = graph_.num_poses() - first_free_pose_;
    return block < poses ? "pose " + std::to_string(block + first_free_pose_)
                         : "object " + std::to_string(block - poses);
  }

  Sparse matrix;
  std::vector<int> block_sizes;

 private:
  const Graph& graph_;
  State state_;
  int first_free_pose_ = 1;
};

// J^T J stores every entry of a block whose residuals do; a block of zeros must be stored as well.
Sparse Damped(const Sparse& H) {
  Sparse damping(H.rows(), H.cols());
  damping.setIdentity();
  for (int i = 0; i < H.rows(); ++i) {
    damping.coeffRef(i, i) = std::max(kDamping * H.coeff(i, i), 1e-300);
  }
  return H + damping;
}

void CheckState(const Graph& graph, const State& state) {
  if (state.poses.rows() != graph.num_poses() || state.poses.cols() != graph.pose_size() ||
      state.landmarks.rows() != graph.num_objects() || state.landmarks.cols() != kLandmarkSize ||
      !state.poses.allFinite() || !state.landmarks.allFinite()) {
    throw std::invalid_argument("state: need finite poses (" + std::to_string(graph.num_poses()) +
                                ", " + std::to_string(graph.pose_size()) + ") and landmarks (" +
                                std::to_string(graph.num_objects()) + ", 9)");
  }
}

}  // namespace

Covariance ComputeCovariance(const Graph& graph, const SolveOptions& options, const State& state) {
  const PreparedGraph prepared(graph, options.mode == Mode::kMapping);
  CheckState(graph, state);
  const Information information(prepared, options, state);
  const std::vector<Eigen::MatrixXd> blocks =
      DiagonalBlocksOfInverse(Damped(information.matrix), information.block_sizes);

  const int k = graph.tangent_size(), first = information.first_free_pose();
  const int free_poses = graph.num_poses() - first;
  Covariance covariance;
  covariance.poses = RowMatrix::Zero(graph.num_poses(), k * k);
  covariance.objects = RowMatrix::Zero(graph.num_objects(), kLandmarkSize * kLandmarkSize);
  int offset = 0;
  for (int b = 0; b < static_cast<int>(blocks.size()); ++b) {
    auto row =
        b < free_poses ? covariance.poses.row(first + b) : covariance.objects.row(b - free_poses);
    row = blocks[b].reshaped().transpose();
    for (int i = 0; i < blocks[b].rows(); ++i) {
      if (blocks[b](i, i) * information.matrix.coeff(offset + i, offset + i) < kUndetermined) {
        continue;
      }
      covariance.under_constrained.push_back(information.NameOf(b) + ": parameter " +
                                             std::to_string(i) +
                                             " is not determined by the data and the priors");
      row.setConstant(std::nan(""));
      break;
    }
    offset += information.block_sizes[b];
  }
  return covariance;
}

}  // namespace dqslam
