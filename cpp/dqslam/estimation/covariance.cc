#include "dqslam/estimation/covariance.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "dqslam/estimation/information.h"
#include "dqslam/linear/selected_inverse.h"

namespace dqslam {
namespace {

// A parameter counts as undetermined if its variance is this many times the variance that it would
// have if all others were known.  Such a value comes from rounding only.
constexpr double kUndetermined = 1e9;

using RowMajorSparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// The leverages of residuals: diagonal entries of J H^-1 J^T.
class Leverages {
 public:
  explicit Leverages(const Information& information)
      : information_(information),
        factor_(Factorize(information.H)),
        inverse_(information.H, factor_) {
    for (int block = 0; block < information.H.num_blocks(); ++block) {
      block_of_column_.insert(block_of_column_.end(), information.H.size(block), block);
    }
  }

  double At(int row) {
    const RowMajorSparse& J = information_.jacobian;
    const int begin = J.outerIndexPtr()[row];
    const int columns = J.outerIndexPtr()[row + 1] - begin;
    FindBlocks(J.innerIndexPtr() + begin, columns);
    const Eigen::Map<const Eigen::VectorXd> j(J.valuePtr() + begin, columns);
    return j.dot(covariance_ * j);
  }

 private:
  // Looks up the inverse at the columns of a row, unless the row before had the same.
  void FindBlocks(const int* column, int columns) {
    std::vector<int> blocks;
    for (int c = 0; c < columns; c += information_.H.size(blocks.back())) {
      blocks.push_back(block_of_column_[column[c]]);
    }
    if (blocks == blocks_) return;
    covariance_.resize(columns, columns);
    int r = 0;
    for (const int a : blocks) {
      int c = 0;
      for (const int b : blocks) {
        const Eigen::MatrixXd block = inverse_.Block(a, b);
        covariance_.block(r, c, block.rows(), block.cols()) = block;
        c += static_cast<int>(block.cols());
      }
      r += information_.H.size(a);
    }
    blocks_ = std::move(blocks);
  }

  const Information& information_;
  const BlockCholesky factor_;
  const SelectedInverse inverse_;
  std::vector<int> block_of_column_;
  std::vector<int> blocks_;     // of the last row
  Eigen::MatrixXd covariance_;  // of these
};

// Columns of some poses and objects in the information matrix; -1 for those of a fixed pose.
std::vector<int> ColumnsOf(const Information& information,
                           const Graph& graph,
                           const std::vector<int>& poses,
                           const std::vector<int>& objects) {
  std::vector<int> columns;
  const auto add = [&](int block) {
    const int start = information.H.offset(block);
    for (int i = 0; i < information.H.size(block); ++i) columns.push_back(start + i);
  };
  for (const int pose : poses) {
    if (pose < 0 || pose >= graph.num_poses()) {
      throw std::invalid_argument("poses: " + std::to_string(pose) + " is no pose");
    }
    if (pose < information.first_free_pose) {
      columns.insert(columns.end(), graph.tangent_size(), -1);
    } else {
      add(information.PoseBlock(pose));
    }
  }
  for (const int object : objects) {
    if (object < 0 || object >= graph.num_objects()) {
      throw std::invalid_argument("objects: " + std::to_string(object) + " is no object");
    }
    add(information.ObjectBlock(object));
  }
  return columns;
}

}  // namespace

Covariance ComputeCovariance(const Graph& graph, const SolveOptions& options, const State& state) {
  const Information information = ComputeInformation(graph, options, state);
  const BlockMatrix& H = information.H;
  const BlockCholesky factor = Factorize(H);
  const SelectedInverse inverse(H, factor);

  const int k = graph.tangent_size();
  Covariance covariance;
  covariance.poses = RowMatrix::Zero(graph.num_poses(), k * k);
  covariance.objects = RowMatrix::Zero(graph.num_objects(), kLandmarkSize * kLandmarkSize);
  covariance.shared.resize(graph.num_shared());
  const Eigen::VectorXd precision = H.diagonal();
  const int blocks = information.num_free_poses + graph.num_objects();
  for (int b = 0; b < blocks; ++b) {
    const bool is_pose = b < information.num_free_poses;
    const int of_table = is_pose ? information.first_free_pose + b : b - information.num_free_poses;
    auto row = is_pose ? covariance.poses.row(of_table) : covariance.objects.row(of_table);
    const Eigen::MatrixXd block = inverse.Block(b, b);
    row = block.reshaped().transpose();
    for (int i = 0; i < H.size(b); ++i) {
      if (block(i, i) * precision[H.offset(b) + i] < kUndetermined) continue;
      covariance.under_constrained.push_back(
          {is_pose ? VariableKind::kPose : VariableKind::kObject, of_table, i});
      row.setConstant(std::nan(""));
      break;
    }
  }
  for (int row = 0; row < graph.num_shared(); ++row) {
    covariance.shared[row] = inverse.Block(blocks + row, blocks + row)(0, 0);
  }
  return covariance;
}

RowMatrix ComputeJointCovariance(const Graph& graph,
                                 const SolveOptions& options,
                                 const State& state,
                                 const std::vector<int>& poses,
                                 const std::vector<int>& objects) {
  const Information information = ComputeInformation(graph, options, state);
  const std::vector<int> columns = ColumnsOf(information, graph, poses, objects);
  std::vector<int> known;  // of the columns
  for (const int column : columns) {
    if (column >= 0) known.push_back(column);
  }
  const Eigen::MatrixXd inverse = InverseAt(Factorize(information.H), known);
  const int size = static_cast<int>(columns.size());
  RowMatrix joint = RowMatrix::Zero(size, size);
  for (int r = 0, at_r = 0; r < size; ++r) {
    if (columns[r] < 0) continue;
    for (int c = 0, at_c = 0; c < size; ++c) {
      if (columns[c] >= 0) joint(r, c) = inverse(at_r, at_c++);
    }
    ++at_r;
  }
  return joint;
}

Fit ComputeFit(const Graph& graph, const SolveOptions& options, const State& state) {
  const Information information = ComputeInformation(graph, options, state);
  Leverages leverages(information);

  const int k = graph.tangent_size();
  Fit fit;
  fit.odometry_residuals = RowMatrix::Zero(graph.odometry.size(), k);
  fit.odometry_leverage = RowMatrix::Zero(graph.odometry.size(), k);
  int row = 0;
  for (int edge = 0; edge < graph.odometry.size(); ++edge) {
    const int later = std::max(graph.odometry.from[edge], graph.odometry.to[edge]);
    if (later < information.first_free_pose) continue;
    for (int i = 0; i < k; ++i, ++row) {
      fit.odometry_residuals(edge, i) = information.residuals[row];
      fit.odometry_leverage(edge, i) = leverages.At(row);
    }
  }
  for (const int end = row + 4 * information.num_boxes; row < end; ++row) {
    const double leverage = leverages.At(row);
    if (leverage == 0) continue;  // The border cut this edge, and the object extends to it.
    fit.box_squares += information.residuals[row] * information.residuals[row];
    fit.box_redundancy += 1 - leverage;
  }
  return fit;
}

}  // namespace dqslam
