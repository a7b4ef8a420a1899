#include "dqslam/estimation/calibration.h"

#include <algorithm>
#include <stdexcept>

#include "dqslam/estimation/information.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/problem/checks.h"
#include "dqslam/solver/terms.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

enum Parameter {
  kPitch,
  kYaw,
  kRoll,
  kForward,
  kLeft,
  kUp,
  kFocalLength,
  kPrincipalU,
  kPrincipalV,
  kDistortion,
  kScale,
  kGyroBias,
  kDelay,
  kSizes,
  kNumParameters
};

// A visitor that writes the residuals of all terms, in the order of ComputeInformation.
template <typename Pose>
class ResidualRows {
 public:
  ResidualRows(const SolveContext& context, const State& state)
      : context_(context), state_(state) {}

  template <typename Cost, typename... Rows>
  bool Visit(const Cost& cost, const Rows&... rows) {
    Eigen::Matrix<double, Cost::kResidualSize, 1> residual;
    if (!cost(ValuesOf(rows)..., residual.data())) return false;
    residuals_.insert(residuals_.end(), residual.data(), residual.data() + residual.size());
    return true;
  }
  bool VisitBox(const StageBox& box) {
    const PoseRow pose{context_.graph().boxes.pose[box.row]};
    const ObjectRow object{context_.graph().boxes.object[box.row]};
    return VisitBoxCost<Pose, EllipsoidModel>(
        context_, box, [&](const auto& cost) { return Visit(cost, pose, object); });
  }
  const std::vector<double>& residuals() const { return residuals_; }

 private:
  const double* ValuesOf(PoseRow pose) const { return state_.poses.row(pose.row).data(); }
  const double* ValuesOf(ObjectRow object) const { return state_.landmarks.row(object.row).data(); }
  const double* ValuesOf(SharedRow shared) const { return state_.SharedAt(shared.row); }

  const SolveContext& context_;
  const State& state_;
  std::vector<double> residuals_;
};

VectorXd ResidualsOf(const Graph& graph,
                     const SolveOptions& options,
                     const StageTerms& terms,
                     const State& state) {
  const PreparedGraph prepared(graph, options.mode == Mode::kMapping);
  const Monitor no_monitor;
  const SolveContext context{prepared, options, no_monitor};
  return Dispatch(graph.pose_model, [&](auto pose) {
    ResidualRows<decltype(pose)> rows(context, state);
    if (!VisitTerms<decltype(pose), EllipsoidModel>(prepared, terms, &rows)) {
      throw std::runtime_error("calibration: a residual is undefined at this state");
    }
    return VectorXd(Eigen::Map<const VectorXd>(rows.residuals().data(), rows.residuals().size()));
  });
}

// The boxes of a state whose cameras are where they are `delay` seconds later.
template <typename Pose>
RowMatrix PredictBoxes(const Graph& graph,
                       const State& state,
                       const VectorXd& times,
                       double delay) {
  const Mount mount(graph.camera);
  const int last = graph.num_poses() - 1;
  RowMatrix boxes = RowMatrix::Constant(graph.boxes.size(), kBoxSize, std::nan(""));
  for (int row = 0; row < graph.boxes.size(); ++row) {
    const int pose = graph.boxes.pose[row];
    const int before = std::max(pose - 1, 0), after = std::min(pose + 1, last);
    Eigen::Matrix<double, Pose::kTangentSize, 1> motion;
    Minus<Pose>(state.poses.row(after).data(), state.poses.row(before).data(), motion.data());
    const double seconds = times[after] - times[before];
    if (seconds > 0) motion *= delay / seconds;
    Eigen::Matrix<double, Pose::kSize, 1> moved;
    Plus<Pose>(state.poses.row(pose).data(), motion.data(), moved.data());
    const Surface<double> surface =
        ToCamera(LocateCamera<Pose>(moved.data(), mount),
                 EllipsoidModel::Unpack(state.landmarks.row(graph.boxes.object[row]).data()));
    Eigen::Vector4d box;
    if (ProjectToBox(surface, graph.camera, &box)) boxes.row(row) = box.transpose();
  }
  return boxes;
}

void CheckTimestamps(const Graph& graph, const VectorXd& timestamps) {
  if (timestamps.size() == graph.num_poses() && timestamps.allFinite()) return;
  throw std::invalid_argument("timestamps: expected a finite one for each pose");
}

}  // namespace

const std::vector<CalibrationParameter>& CalibrationParameters() {
  static const std::vector<CalibrationParameter> parameters = {{"mount_pitch", "rad", 1e-5},
                                                               {"mount_yaw", "rad", 1e-5},
                                                               {"mount_roll", "rad", 1e-5},
                                                               {"mount_forward", "m", 1e-5},
                                                               {"mount_left", "m", 1e-5},
                                                               {"mount_up", "m", 1e-5},
                                                               {"focal_length", "", 1e-5},
                                                               {"principal_u", "px", 1e-2},
                                                               {"principal_v", "px", 1e-2},
                                                               {"distortion", "", 1e-5},
                                                               {"odometry_scale", "", 1e-5},
                                                               {"gyro_bias", "rad/s", 1e-6},
                                                               {"time_offset", "s", 1e-4},
                                                               {"object_size", "", 1e-3}};
  return parameters;
}

Graph Recalibrate(const Graph& graph,
                  const State& state,
                  const VectorXd& timestamps,
                  const VectorXd& deviations) {
  if (deviations.size() != kNumParameters) {
    throw std::invalid_argument("deviations: expected one for each parameter");
  }
  CheckTimestamps(graph, timestamps);
  Graph result = graph;
  Camera& camera = result.camera;
  const Eigen::Matrix<double, 6, 1> turn =
      (Eigen::Matrix<double, 6, 1>() << 0, 0, 0, deviations.head<3>()).finished();
  Plus<Se3>(graph.camera.robot_from_camera.data(), turn.data(), camera.robot_from_camera.data());
  camera.robot_from_camera.head<3>() += deviations.segment<3>(kForward);
  camera.fx *= 1 + deviations[kFocalLength];
  camera.fy *= 1 + deviations[kFocalLength];
  camera.cx += deviations[kPrincipalU];
  camera.cy += deviations[kPrincipalV];
  if (deviations[kDistortion] != 0) {
    Camera distorted = camera;
    distorted.distortion.setZero();
    distorted.distortion[0] = deviations[kDistortion];
    result.boxes.box = distorted.UndistortBoxes(graph.boxes.box);
  }
  result.size_prior.log_mean.array() += deviations[kSizes];
  OdometryTable& odometry = result.odometry;
  const int translations = graph.pose_model == PoseModel::kSe2 ? 2 : 3;
  // The noise scales with the steps.  Otherwise, shorter steps would fit better just because their
  // residuals are shorter.
  const double scale = 1 + deviations[kScale];
  odometry.relative.leftCols(translations) *= scale;
  const int k = graph.tangent_size();
  for (int entry = 0; entry < k * k; ++entry) {
    if (entry / k < translations) odometry.covariance.col(entry) *= scale;
    if (entry % k < translations) odometry.covariance.col(entry) *= scale;
  }
  Dispatch(graph.pose_model, [&](auto model) {
    using Pose = decltype(model);
    Eigen::Matrix<double, Pose::kTangentSize, 1> bias;
    for (int row = 0; row < odometry.size() && deviations[kGyroBias] != 0; ++row) {
      bias.setZero();
      bias[Pose::kTangentSize - 1] =
          deviations[kGyroBias] * (timestamps[odometry.to[row]] - timestamps[odometry.from[row]]);
      Eigen::Matrix<double, Pose::kSize, 1> turned;
      Plus<Pose>(odometry.relative.row(row).data(), bias.data(), turned.data());
      odometry.relative.row(row) = turned.transpose();
    }
    if (deviations[kDelay] != 0) {
      const RowMatrix shift = PredictBoxes<Pose>(graph, state, timestamps, deviations[kDelay]) -
                              PredictBoxes<Pose>(graph, state, timestamps, 0);
      for (int row = 0; row < graph.boxes.size(); ++row) {
        if (shift.row(row).allFinite()) result.boxes.box.row(row) -= shift.row(row);
      }
    }
  });
  return result;
}

CalibrationScore ScoreCalibration(const Graph& graph,
                                  const SolveOptions& options,
                                  const State& state,
                                  const VectorXd& timestamps) {
  CheckTimestamps(graph, timestamps);
  if (!AreEllipsoids(graph.shapes)) {
    throw std::invalid_argument("calibration: all objects must be ellipsoids, without shapes");
  }
  if (options.landmark_model != LandmarkModel::kEllipsoid) {
    throw std::invalid_argument("calibration: only ellipsoids have exact boxes");
  }
  const Information information = ComputeInformation(graph, options, state);
  const StageTerms terms = InformationTerms(graph, options, state);
  const auto& parameters = CalibrationParameters();
  Eigen::MatrixXd by_parameter(information.residuals.size(), kNumParameters);
  for (int i = 0; i < kNumParameters; ++i) {
    VectorXd deviations = VectorXd::Zero(kNumParameters);
    deviations[i] = parameters[i].step;
    const Graph above = Recalibrate(graph, state, timestamps, deviations);
    deviations[i] *= -1;
    const Graph below = Recalibrate(graph, state, timestamps, deviations);
    by_parameter.col(i) =
        (ResidualsOf(above, options, terms, state) - ResidualsOf(below, options, terms, state)) /
        (2 * parameters[i].step);
  }

  const BlockCholesky factor = Factorize(information.H);
  const auto& J = information.jacobian;
  Eigen::MatrixXd projected = by_parameter;
  for (int i = 0; i < kNumParameters; ++i) {
    projected.col(i) -= J * factor.Solve(J.transpose() * by_parameter.col(i));
  }
  const int boxes = kBoxSize * information.num_boxes;
  const int odometry = static_cast<int>(terms.odometry.size()) * graph.tangent_size();
  CalibrationScore result;
  result.score = -projected.transpose() * information.residuals;
  result.information = projected.transpose() * projected;
  result.unchecked = by_parameter.colwise().squaredNorm();
  const auto of_odometry = projected.topRows(odometry);
  const auto of_boxes = projected.middleRows(odometry, boxes);
  result.from_odometry = of_odometry.transpose() * of_odometry;
  result.from_boxes = of_boxes.transpose() * of_boxes;
  return result;
}

}  // namespace dqslam
