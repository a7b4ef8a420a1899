#include "dqslam/problem/graph.h"

#include <cmath>
#include <iomanip>
#include <sstream>
#include <stdexcept>

#include "dqslam/costs/measurements.h"
#include "dqslam/costs/whitening.h"

namespace dqslam {
namespace {

[[noreturn]] void Fail(const std::string& table, Eigen::Index row, const std::string& what) {
  throw std::invalid_argument(table + " row " + std::to_string(row) + ": " + what);
}

void CheckShape(const std::string& table,
                const RowMatrix& values,
                Eigen::Index rows,
                Eigen::Index columns) {
  if (values.rows() != rows || (rows > 0 && values.cols() != columns)) {
    throw std::invalid_argument(table + " has shape (" + std::to_string(values.rows()) + ", " +
                                std::to_string(values.cols()) + "), expected (" +
                                std::to_string(rows) + ", " + std::to_string(columns) + ")");
  }
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (!values.row(row).allFinite()) Fail(table, row, "NaN or infinite number");
  }
}

void CheckIds(const std::string& table, const IndexVector& ids, Eigen::Index rows, int count) {
  if (ids.size() != rows) {
    throw std::invalid_argument(table + " has " + std::to_string(ids.size()) +
                                " entries, expected " + std::to_string(rows));
  }
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (ids[row] < 0 || ids[row] >= count) {
      Fail(table,
           row,
           "unknown id " + std::to_string(ids[row]) + ", there are " + std::to_string(count));
    }
  }
}

template <int kSize>
void CheckCovariance(const std::string& table, const RowMatrix& covariance) {
  using Square = Eigen::Matrix<double, kSize, kSize, Eigen::RowMajor>;
  for (Eigen::Index row = 0; row < covariance.rows(); ++row) {
    try {
      SqrtInformation<kSize>(Eigen::Map<const Square>(covariance.row(row).data()));
    } catch (const std::invalid_argument& error) {
      Fail(table, row, error.what());
    }
  }
}

void CheckUnitQuaternions(const std::string& table, PoseModel model, const RowMatrix& poses) {
  if (model != PoseModel::kSe3) return;
  for (Eigen::Index row = 0; row < poses.rows(); ++row) {
    if (std::abs(poses.row(row).tail<4>().norm() - 1) > 1e-6) {
      Fail(table, row, "the quaternion is not unit");
    }
  }
}

void ValidateOdometry(const Graph& graph, bool poses_known) {
  const OdometryTable& odometry = graph.odometry;
  const int rows = odometry.size(), k = graph.tangent_size();
  CheckIds("odometry_from", odometry.from, rows, graph.num_poses());
  CheckIds("odometry_to", odometry.to, rows, graph.num_poses());
  CheckShape("odometry", odometry.relative, rows, graph.pose_size());
  CheckUnitQuaternions("odometry", graph.pose_model, odometry.relative);
  CheckShape("odometry_covariance", odometry.covariance, rows, k * k);
  if (graph.pose_model == PoseModel::kSe2) {
    CheckCovariance<3>("odometry_covariance", odometry.covariance);
  } else {
    CheckCovariance<6>("odometry_covariance", odometry.covariance);
  }
  std::vector<bool> reached(graph.num_poses(), false);
  for (int row = 0; row < rows; ++row) {
    if (odometry.from[row] == odometry.to[row]) Fail("odometry_to", row, "a pose follows itself");
    if (odometry.from[row] < odometry.to[row]) reached[odometry.to[row]] = true;
  }
  for (int pose = 1; pose < graph.num_poses() && !poses_known; ++pose) {
    if (!reached[pose]) {
      Fail("initial_poses", pose, "no odometry leads to this pose from an earlier one");
    }
  }
}

void ValidateBoxes(const Graph& graph) {
  const BoxTable& boxes = graph.boxes;
  const int rows = boxes.size();
  CheckIds("box_pose", boxes.pose, rows, graph.num_poses());
  CheckIds("box_object", boxes.object, rows, graph.num_objects());
  CheckShape("boxes", boxes.box, rows, kBoxSize);
  CheckShape("box_covariance", boxes.covariance, rows, kBoxSize * kBoxSize);
  CheckCovariance<kBoxSize>("box_covariance", boxes.covariance);
  if (boxes.truncated.rows() != rows || (rows > 0 && boxes.truncated.cols() != kBoxSize)) {
    throw std::invalid_argument("box_truncated has " + std::to_string(boxes.truncated.rows()) +
                                " rows of " + std::to_string(boxes.truncated.cols()) +
                                ", expected " + std::to_string(rows) + " of 4");
  }
  std::vector<bool> seen(graph.num_objects(), false);
  for (int row = 0; row < rows; ++row) {
    if (boxes.box(row, 0) >= boxes.box(row, 2) || boxes.box(row, 1) >= boxes.box(row, 3)) {
      Fail("boxes", row, "inverted or empty box: need u_min < u_max and v_min < v_max");
    }
    seen[boxes.object[row]] = true;
  }
  for (int object = 0; object < graph.num_objects(); ++object) {
    if (!seen[object]) Fail("log_size_mean", object, "no box shows this object");
  }
}

void ValidateMeasurements(const Graph& graph, const MeasurementTable& table) {
  const int kind = MeasurementKind(table.kind);
  if (kind < 0) {
    throw std::invalid_argument("measurements: there is no kind '" + table.kind + "'");
  }
  const int m = MeasurementSize(kind);
  CheckIds(table.kind + "_pose", table.pose, table.size(), graph.num_poses());
  CheckIds(table.kind + "_object", table.object, table.size(), graph.num_objects());
  CheckShape(table.kind + "_value", table.value, table.size(), m);
  CheckShape(table.kind + "_covariance", table.covariance, table.size(), m * m);
  for (int row = 0; row < table.size(); ++row) {
    try {
      MeasurementSqrtInformation(kind, table.covariance.row(row).data());
    } catch (const std::invalid_argument& error) {
      Fail(table.kind + "_covariance", row, error.what());
    }
  }
}

void ValidateScenePriors(const ScenePriors& priors) {
  const Eigen::Vector4d numbers(
      priors.plane_offset, priors.upright_sigma, priors.support_sigma, priors.camera_height_sigma);
  if (!priors.up.allFinite() || std::abs(priors.up.norm() - 1) > 1e-6) {
    throw std::invalid_argument("scene_priors: up must be a unit vector");
  }
  if (!numbers.allFinite() || !std::isfinite(priors.camera_height) ||
      numbers.tail<3>().minCoeff() < 0) {
    throw std::invalid_argument(
        "scene_priors: numbers must be finite, and sigmas positive, or 0 for off");
  }
}

}  // namespace

void Validate(const Graph& graph, bool poses_known) {
  graph.camera.Validate();
  if (graph.num_poses() < 1) throw std::invalid_argument("initial_poses: need at least one pose");
  CheckShape("initial_poses", graph.initial_poses, graph.num_poses(), graph.pose_size());
  CheckUnitQuaternions("initial_poses", graph.pose_model, graph.initial_poses);
  CheckShape("log_size_mean", graph.size_prior.log_mean, graph.num_objects(), 1);
  CheckShape("log_size_sigma", graph.size_prior.log_sigma, graph.num_objects(), 1);
  for (int object = 0; object < graph.num_objects(); ++object) {
    if (graph.size_prior.log_sigma[object] <= 0) {
      Fail("log_size_sigma", object, "must be positive");
    }
  }
  ValidateOdometry(graph, poses_known);
  ValidateBoxes(graph);
  ValidateScenePriors(graph.scene_priors);
  for (const MeasurementTable& table : graph.measurements) ValidateMeasurements(graph, table);
}

void Append(const Summary& stage, Summary* total) {
  const Summary before = *total;
  *total = stage;
  total->iterations += before.iterations;
  total->rejected_steps += before.rejected_steps;
  total->seconds += before.seconds;
  total->start_seconds += before.start_seconds;
  total->evaluation_seconds += before.evaluation_seconds;
  total->linear_solver_seconds += before.linear_solver_seconds;
  if (!before.message.empty()) total->initial_cost = before.initial_cost;
}

std::string ToString(const Summary& summary) {
  std::ostringstream text;
  text << std::setprecision(6) << (summary.converged ? "converged" : "did not converge")
       << ": cost " << summary.initial_cost << " -> " << summary.final_cost << " in "
       << summary.iterations << " iterations (" << summary.rejected_steps << " steps rejected), "
       << std::setprecision(3) << summary.seconds << " s; gradient " << summary.gradient_norm_start
       << " -> " << summary.gradient_norm_end << "; " << summary.message;
  return text.str();
}

}  // namespace dqslam
