#include "dqslam/estimation/covariance.h"

#include <Eigen/SparseCholesky>
#include <cmath>
#include <stdexcept>

#include "dqslam/estimation/information.h"
#include "dqslam/linear/selected_inverse.h"

namespace dqslam {
namespace {

// A parameter counts as undetermined if its variance is this many times the variance that it would
// have if all others were known.  Such a value comes from rounding only.
constexpr double kUndetermined = 1e9;

using RowMajorSparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;

// The leverage of a residual: its diagonal entry of J H^-1 J^T.
double Leverage(const RowMajorSparse& J, int row, const SelectedInverse& inverse) {
  double leverage = 0;
  for (RowMajorSparse::InnerIterator a(J, row); a; ++a) {
    for (RowMajorSparse::InnerIterator b(J, row); b; ++b) {
      leverage += a.value() * inverse(a.col(), b.col()) * b.value();
    }
  }
  return leverage;
}

// Columns of some poses and objects in the information matrix; -1 for those of a fixed pose.
std::vector<int> ColumnsOf(const Information& information,
                           const Graph& graph,
                           const std::vector<int>& poses,
                           const std::vector<int>& objects) {
  std::vector<int> columns;
  const auto add = [&columns](int start, int size) {
    for (int i = 0; i < size; ++i) columns.push_back(start < 0 ? -1 : start + i);
  };
  for (const int pose : poses) {
    if (pose < 0 || pose >= graph.num_poses()) {
      throw std::invalid_argument("poses: " + std::to_string(pose) + " is no pose");
    }
    const bool fixed = pose < information.first_free_pose;
    add(fixed ? -1 : information.PoseColumn(pose), graph.tangent_size());
  }
  for (const int object : objects) {
    if (object < 0 || object >= graph.num_objects()) {
      throw std::invalid_argument("objects: " + std::to_string(object) + " is no object");
    }
    add(information.ObjectColumn(object), kLandmarkSize);
  }
  return columns;
}

}  // namespace

Covariance ComputeCovariance(const Graph& graph, const SolveOptions& options, const State& state) {
  const Information information = ComputeInformation(graph, options, state);
  const SelectedInverse inverse(Damped(information.matrix));

  const int k = graph.tangent_size();
  Covariance covariance;
  covariance.poses = RowMatrix::Zero(graph.num_poses(), k * k);
  covariance.objects = RowMatrix::Zero(graph.num_objects(), kLandmarkSize * kLandmarkSize);
  int offset = 0;
  covariance.shared.resize(graph.num_shared());
  const int blocks = information.num_free_poses + graph.num_objects();
  for (int b = 0; b < blocks; ++b) {
    const int size = information.block_sizes[b];
    const bool is_pose = b < information.num_free_poses;
    const int of_table = is_pose ? information.first_free_pose + b : b - information.num_free_poses;
    auto row = is_pose ? covariance.poses.row(of_table) : covariance.objects.row(of_table);
    const Eigen::MatrixXd block = inverse.Block(offset, size);
    row = block.reshaped().transpose();
    for (int i = 0; i < size; ++i) {
      if (block(i, i) * information.matrix.coeff(offset + i, offset + i) < kUndetermined) continue;
      covariance.under_constrained.push_back(
          {is_pose ? VariableKind::kPose : VariableKind::kObject, of_table, i});
      row.setConstant(std::nan(""));
      break;
    }
    offset += size;
  }
  for (int row = 0; row < graph.num_shared(); ++row, ++offset) {
    covariance.shared[row] = inverse(offset, offset);
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
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(Damped(information.matrix));
  if (factor.info() != Eigen::Success) {
    throw std::runtime_error("the information matrix is not positive definite");
  }
  const int size = static_cast<int>(columns.size());
  RowMatrix joint = RowMatrix::Zero(size, size);
  Eigen::VectorXd unit = Eigen::VectorXd::Zero(information.matrix.rows());
  for (int c = 0; c < size; ++c) {
    if (columns[c] < 0) continue;
    unit[columns[c]] = 1;
    const Eigen::VectorXd column = factor.solve(unit);
    unit[columns[c]] = 0;
    for (int r = 0; r < size; ++r) {
      if (columns[r] >= 0) joint(r, c) = column[columns[r]];
    }
  }
  return joint;
}

Fit ComputeFit(const Graph& graph, const SolveOptions& options, const State& state) {
  const Information information = ComputeInformation(graph, options, state);
  const SelectedInverse inverse(Damped(information.matrix));
  const RowMajorSparse J = information.jacobian;

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
      fit.odometry_leverage(edge, i) = Leverage(J, row, inverse);
    }
  }
  for (const int end = row + 4 * information.num_boxes; row < end; ++row) {
    const double leverage = Leverage(J, row, inverse);
    if (leverage == 0) continue;  // The border cut this edge, and the object extends to it.
    fit.box_squares += information.residuals[row] * information.residuals[row];
    fit.box_redundancy += 1 - leverage;
  }
  return fit;
}

}  // namespace dqslam
