#include "dqslam/estimation/information.h"

#include <ceres/crs_matrix.h>
#include <ceres/problem.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/solver/assembly.h"

namespace dqslam {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

// Far below what the data say.
constexpr double kDamping = 1e-12;

void CheckState(const Graph& graph, const State& state) {
  if (state.poses.rows() != graph.num_poses() || state.poses.cols() != graph.pose_size() ||
      state.landmarks.rows() != graph.num_objects() || state.landmarks.cols() != kLandmarkSize ||
      !state.poses.allFinite() || !state.landmarks.allFinite()) {
    throw std::invalid_argument("state: need finite poses (" + std::to_string(graph.num_poses()) +
                                ", " + std::to_string(graph.pose_size()) + ") and landmarks (" +
                                std::to_string(graph.num_objects()) + ", 9)");
  }
}

Stage StageOfInliers(const PreparedGraph& prepared,
                     const SolveOptions& options,
                     const State& state) {
  Stage stage = BatchStage(prepared, options);
  if (IsRobust(options.loss)) {
    const std::vector<bool> inliers = InlierBoxes(prepared, options, state);
    stage.weights.assign(inliers.begin(), inliers.end());
    stage.loss = Loss::kNone;
  }
  return stage;
}

}  // namespace

int Information::PoseColumn(int pose) const {
  return block_sizes.empty() ? 0 : (pose - first_free_pose) * block_sizes.front();
}

int Information::ObjectColumn(int object) const {
  const auto begin = block_sizes.begin();
  return std::accumulate(begin, begin + num_free_poses, 0) + object * kLandmarkSize;
}

std::string Information::NameOf(int block) const {
  return block < num_free_poses ? "pose " + std::to_string(block + first_free_pose)
                                : "object " + std::to_string(block - num_free_poses);
}

Information ComputeInformation(const Graph& graph, const SolveOptions& options, State state) {
  const PreparedGraph prepared(graph, options.mode == Mode::kMapping);
  CheckState(graph, state);
  const Stage stage = StageOfInliers(prepared, options, state);
  ceres::Problem problem;
  Assemble(prepared, options, stage, &state, &problem);

  Information information;
  information.first_free_pose = stage.first_free_pose;
  information.num_free_poses = graph.num_poses() - stage.first_free_pose;
  information.num_boxes =
      graph.boxes.size() -
      static_cast<int>(std::count(stage.weights.begin(), stage.weights.end(), 0.0));
  ceres::Problem::EvaluateOptions evaluate;
  for (int pose = stage.first_free_pose; pose < graph.num_poses(); ++pose) {
    evaluate.parameter_blocks.push_back(state.poses.row(pose).data());
    information.block_sizes.push_back(graph.tangent_size());
  }
  for (int object = 0; object < graph.num_objects(); ++object) {
    evaluate.parameter_blocks.push_back(state.landmarks.row(object).data());
    information.block_sizes.push_back(kLandmarkSize);
  }
  ceres::CRSMatrix crs;
  std::vector<double> residuals;
  double cost = 0;
  if (!problem.Evaluate(evaluate, &cost, &residuals, nullptr, &crs)) {
    throw std::runtime_error("covariance: a residual is undefined at this state");
  }
  information.residuals =
      Eigen::Map<const Eigen::VectorXd>(residuals.data(), static_cast<int>(residuals.size()));
  information.jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      crs.num_rows,
      crs.num_cols,
      static_cast<int>(crs.values.size()),
      crs.rows.data(),
      crs.cols.data(),
      crs.values.data());
  information.matrix = Sparse(information.jacobian.transpose()) * information.jacobian;
  return information;
}

// J^T J stores every entry of a block whose residuals do; a block of zeros must be stored as well.
Sparse Damped(const Sparse& H) {
  Sparse damping(H.rows(), H.cols());
  damping.setIdentity();
  for (int i = 0; i < H.rows(); ++i) {
    damping.coeffRef(i, i) = std::max(kDamping * H.coeff(i, i), 1e-300);
  }
  return H + damping;
}

}  // namespace dqslam
