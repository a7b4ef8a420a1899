#include "dqslam/problem/checks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dqslam/costs/measurements.h"

namespace dqslam {

void FailAt(const std::string& table, Eigen::Index row, const std::string& what) {
  throw std::invalid_argument(table + " row " + std::to_string(row) + ": " + what);
}

void CheckTable(const std::string& table,
                const RowMatrix& values,
                Eigen::Index rows,
                Eigen::Index columns) {
  if (values.rows() != rows || (rows > 0 && values.cols() != columns)) {
    throw std::invalid_argument(table + " has shape (" + std::to_string(values.rows()) + ", " +
                                std::to_string(values.cols()) + "), expected (" +
                                std::to_string(rows) + ", " + std::to_string(columns) + ")");
  }
  if (values.allFinite()) return;
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (!values.row(row).allFinite()) FailAt(table, row, "NaN or infinite number");
  }
}

void CheckIds(const std::string& table,
              const IndexVector& ids,
              Eigen::Index rows,
              Eigen::Index count,
              int least) {
  if (ids.size() != rows) {
    throw std::invalid_argument(table + " has " + std::to_string(ids.size()) +
                                " entries, expected " + std::to_string(rows));
  }
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (ids[row] >= least && ids[row] < count) continue;
    FailAt(table,
           row,
           "unknown id " + std::to_string(ids[row]) + ", there are " + std::to_string(count));
  }
}

void CheckDistinct(const std::string& table, const IndexVector& ids) {
  std::vector<Eigen::Index> order(ids.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(
      order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) { return ids[a] < ids[b]; });
  for (size_t i = 1; i < order.size(); ++i) {
    if (ids[order[i]] == ids[order[i - 1]]) {
      FailAt(table, order[i], "repeats row " + std::to_string(order[i - 1]));
    }
  }
}

void CheckShown(const std::string& table, Eigen::Index rows, const IndexVector& ids, int first) {
  std::vector<bool> is_shown(rows, false);
  for (const int id : ids) {
    if (id >= first) is_shown[id - first] = true;
  }
  const auto missing = std::find(is_shown.begin(), is_shown.end(), false);
  if (missing != is_shown.end()) {
    FailAt(table, missing - is_shown.begin(), "no box shows this object");
  }
}

void CheckUnitQuaternions(const std::string& table, PoseModel model, const RowMatrix& poses) {
  if (model != PoseModel::kSe3) return;
  for (Eigen::Index row = 0; row < poses.rows(); ++row) {
    if (std::abs(poses.row(row).tail<4>().norm() - 1) > 1e-6) {
      FailAt(table, row, "the quaternion is not unit");
    }
  }
}

void CheckBoxes(const RowMatrix& box,
                const RowMatrix& covariance,
                const BoolTable& truncated,
                Eigen::Index rows) {
  CheckTable("boxes", box, rows, kBoxSize);
  CheckCovariances<kBoxSize>("box_covariance", covariance, rows);
  if (truncated.rows() != rows || (rows > 0 && truncated.cols() != kBoxSize)) {
    throw std::invalid_argument("box_truncated has " + std::to_string(truncated.rows()) +
                                " rows of " + std::to_string(truncated.cols()) + ", expected " +
                                std::to_string(rows) + " of 4");
  }
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (box(row, 0) >= box(row, 2) || box(row, 1) >= box(row, 3)) {
      FailAt("boxes", row, "inverted or empty box: need u_min < u_max and v_min < v_max");
    }
  }
}

void CheckMeasurements(const MeasurementTable& table, Eigen::Index rows, Eigen::Index num_objects) {
  const int kind = MeasurementKind(table.kind);
  if (kind < 0) {
    throw std::invalid_argument("measurements: there is no kind '" + table.kind + "'");
  }
  const int m = MeasurementSize(kind);
  const std::string covariance = table.kind + "_covariance";
  CheckIds(table.kind + "_object", table.object, rows, num_objects);
  CheckTable(table.kind + "_value", table.value, rows, m);
  CheckTable(covariance, table.covariance, rows, m * m);
  for (Eigen::Index row = 0; row < rows; ++row) {
    try {
      MeasurementSqrtInformation(kind, table.covariance.row(row).data());
    } catch (const std::invalid_argument& error) {
      FailAt(covariance, row, error.what());
    }
  }
}

void CheckSizePriors(const Eigen::VectorXd& log_mean,
                     const Eigen::VectorXd& log_sigma,
                     Eigen::Index rows) {
  CheckTable("log_size_mean", log_mean, rows, 1);
  CheckTable("log_size_sigma", log_sigma, rows, 1);
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (log_sigma[row] <= 0) FailAt("log_size_sigma", row, "must be positive");
  }
}

void CheckScenePriors(const ScenePriors& priors) {
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

namespace {

void CheckShapes(const std::string& name, const std::vector<Shape>& shapes, int num_objects) {
  if (shapes.empty() || static_cast<int>(shapes.size()) == num_objects) return;
  throw std::invalid_argument(name + " has " + std::to_string(shapes.size()) +
                              " entries, expected one for each of " + std::to_string(num_objects) +
                              " objects, or none");
}

}  // namespace

void CheckState(const std::string& name, const Graph& graph, const State& state) {
  if (state.poses.rows() != graph.num_poses() || state.poses.cols() != graph.pose_size() ||
      state.landmarks.rows() != graph.num_objects() || state.landmarks.cols() != kLandmarkSize ||
      !state.poses.allFinite() || !state.landmarks.allFinite()) {
    throw std::invalid_argument(name + ": need finite poses (" + std::to_string(graph.num_poses()) +
                                ", " + std::to_string(graph.pose_size()) + ") and landmarks (" +
                                std::to_string(graph.num_objects()) + ", 9)");
  }
  CheckShapes(name + ": shapes", state.shapes, graph.num_objects());
  if (state.shared.size() != 0 &&
      (state.shared.size() != graph.num_shared() || !state.shared.allFinite())) {
    throw std::invalid_argument(name + ": need " + std::to_string(graph.num_shared()) +
                                " finite shared numbers, or none");
  }
  if (std::count(state.shapes.begin(), state.shapes.end(), Shape::kAuto) > 0) {
    throw std::invalid_argument(name + ": shapes: a state has no AUTO");
  }
}

namespace {

void CheckOdometry(const Graph& graph, bool poses_known) {
  const OdometryTable& odometry = graph.odometry;
  const int rows = odometry.size();
  CheckIds("odometry_from", odometry.from, rows, graph.num_poses());
  CheckIds("odometry_to", odometry.to, rows, graph.num_poses());
  CheckTable("odometry", odometry.relative, rows, graph.pose_size());
  CheckUnitQuaternions("odometry", graph.pose_model, odometry.relative);
  if (graph.pose_model == PoseModel::kSe2) {
    CheckCovariances<3>("odometry_covariance", odometry.covariance, rows);
  } else {
    CheckCovariances<6>("odometry_covariance", odometry.covariance, rows);
  }
  std::vector<bool> is_reached(graph.num_poses(), false);
  for (int row = 0; row < rows; ++row) {
    if (odometry.from[row] == odometry.to[row]) FailAt("odometry_to", row, "a pose follows itself");
    if (odometry.from[row] < odometry.to[row]) is_reached[odometry.to[row]] = true;
  }
  for (int pose = 1; pose < graph.num_poses() && !poses_known; ++pose) {
    if (!is_reached[pose]) {
      FailAt("initial_poses", pose, "no odometry leads to this pose from an earlier one");
    }
  }
}

}  // namespace

namespace {

void CheckShared(const std::string& name, const IndexVector& shared, const Graph& graph) {
  for (Eigen::Index row = 0; row < shared.size(); ++row) {
    if (shared[row] < -1 || shared[row] >= graph.num_shared()) {
      FailAt(name, row, "is neither -1 nor a row of shared_sigma");
    }
  }
}

void CheckPlacements(const Graph& graph) {
  const PlacementTable& table = graph.placements;
  const Eigen::Index rows = table.size();
  if (static_cast<Eigen::Index>(table.kind.size()) != rows || table.other.size() != rows ||
      table.shared.size() != rows) {
    throw std::invalid_argument("placements: kind, object, other and shared differ in length");
  }
  CheckIds("placement_object", table.object, rows, graph.num_objects());
  CheckTable("placement_distance", table.distance, rows, 1);
  CheckTable("placement_sigma", table.sigma, rows, 1);
  CheckShared("placement_shared", table.shared, graph);
  for (Eigen::Index row = 0; row < rows; ++row) {
    const int other = table.other[row];
    const bool on_plane = table.kind[row] == Placement::kOn && table.shared[row] >= 0;
    const bool needs_other = !on_plane && table.kind[row] != Placement::kUpright;
    if (other < -1 || other >= graph.num_objects() || other == table.object[row]) {
      FailAt("placement_other", row, "is neither -1 nor another object");
    }
    if (needs_other != (other >= 0)) {
      FailAt("placement_other", row, needs_other ? "must be an object" : "must be -1");
    }
    if (table.sigma[row] <= 0) FailAt("placement_sigma", row, "must be positive");
    // The squares of residuals must stay finite, or their switches would hide them.
    if (table.sigma[row] < 1e-9) FailAt("placement_sigma", row, "must be at least 1e-9");
  }
}

}  // namespace

void Validate(const Graph& graph, bool poses_known) {
  graph.camera.Validate();
  if (graph.num_poses() < 1) throw std::invalid_argument("initial_poses: need at least one pose");
  CheckTable("initial_poses", graph.initial_poses, graph.num_poses(), graph.pose_size());
  CheckUnitQuaternions("initial_poses", graph.pose_model, graph.initial_poses);
  CheckSizePriors(graph.size_prior.log_mean, graph.size_prior.log_sigma, graph.num_objects());
  CheckOdometry(graph, poses_known);

  const BoxTable& boxes = graph.boxes;
  CheckIds("box_pose", boxes.pose, boxes.size(), graph.num_poses());
  CheckIds("box_object", boxes.object, boxes.size(), graph.num_objects());
  CheckBoxes(boxes.box, boxes.covariance, boxes.truncated, boxes.size());
  CheckShown("log_size_mean", graph.num_objects(), boxes.object);

  for (const MeasurementTable& table : graph.measurements) {
    CheckIds(table.kind + "_pose", table.pose, table.pose.size(), graph.num_poses());
    CheckMeasurements(table, table.pose.size(), graph.num_objects());
  }
  CheckScenePriors(graph.scene_priors);
  CheckShapes("shapes", graph.shapes, graph.num_objects());
  CheckTable("shared_sigma", graph.shared_sigma, graph.num_shared(), 1);
  for (int row = 0; row < graph.num_shared(); ++row) {
    if (graph.shared_sigma[row] <= 0) FailAt("shared_sigma", row, "must be positive");
  }
  if (graph.size_prior.shared.size() != 0) {
    if (graph.size_prior.shared.size() != graph.num_objects()) {
      throw std::invalid_argument("size_prior: shared needs a row for each object");
    }
    CheckShared("size_prior: shared", graph.size_prior.shared, graph);
  }
  CheckPlacements(graph);
}

}  // namespace dqslam
