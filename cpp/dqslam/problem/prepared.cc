#include "dqslam/problem/prepared.h"

#include <algorithm>
#include <utility>

#include "dqslam/costs/measurements.h"
#include "dqslam/costs/whitening.h"

namespace dqslam {

namespace {

template <int kSize>
Eigen::Matrix<double, kSize, kSize> RowToSquare(const RowMatrix& table, int row) {
  return Eigen::Map<const Eigen::Matrix<double, kSize, kSize, Eigen::RowMajor>>(
      table.row(row).data());
}

// Most rows are the same as the one before.
template <int kSize, typename Square>
std::vector<Square> SqrtInformationOfRows(const RowMatrix& covariance) {
  std::vector<Square> result;
  result.reserve(covariance.rows());
  for (int row = 0; row < covariance.rows(); ++row) {
    if (row > 0 && covariance.row(row) == covariance.row(row - 1)) {
      result.push_back(result.back());
      continue;
    }
    result.push_back(SqrtInformation<kSize>(RowToSquare<kSize>(covariance, row)));
  }
  return result;
}

}  // namespace

PreparedGraph::PreparedGraph(const Graph& graph, bool poses_known)
    : graph((Validate(graph, poses_known), graph)), mount(graph.camera) {
  odometry_sqrt_information =
      graph.pose_model == PoseModel::kSe2
          ? SqrtInformationOfRows<3, Eigen::MatrixXd>(graph.odometry.covariance)
          : SqrtInformationOfRows<6, Eigen::MatrixXd>(graph.odometry.covariance);
  box_sqrt_information = SqrtInformationOfRows<4, Eigen::Matrix4d>(graph.boxes.covariance);
  for (const MeasurementTable& table : graph.measurements) {
    const int kind = MeasurementKind(table.kind);
    RowMatrix sqrt_information(table.size(), table.covariance.cols());
    for (int row = 0; row < table.size(); ++row) {
      sqrt_information.row(row) = MeasurementSqrtInformation(kind, table.covariance.row(row).data())
                                      .reshaped<Eigen::RowMajor>()
                                      .transpose();
    }
    measurement_kinds.push_back(kind);
    measurement_sqrt_information.push_back(std::move(sqrt_information));
  }

  boxes_of_object.resize(graph.num_objects());
  for (int row = 0; row < graph.boxes.size(); ++row) {
    boxes_of_object[graph.boxes.object[row]].push_back(row);
  }
  for (std::vector<int>& rows : boxes_of_object) {
    std::stable_sort(rows.begin(), rows.end(), [&](int a, int b) {
      return graph.boxes.pose[a] < graph.boxes.pose[b];
    });
  }
  odometry_into.assign(graph.num_poses(), -1);
  for (int row = 0; row < graph.odometry.size(); ++row) {
    if (graph.odometry.from[row] < graph.odometry.to[row]) {
      odometry_into[graph.odometry.to[row]] = row;
    }
  }
}

CameraInWorld<double> LocateCamera(const PreparedGraph& prepared, const State& state, int pose) {
  const double* world_from_robot = state.poses.row(pose).data();
  return prepared.graph.pose_model == PoseModel::kSe2
             ? LocateCamera<Se2>(world_from_robot, prepared.mount)
             : LocateCamera<Se3>(world_from_robot, prepared.mount);
}

void DeadReckon(const PreparedGraph& prepared, int begin, int end, State* state) {
  const OdometryTable& odometry = prepared.graph.odometry;
  for (int pose = std::max(begin, 1); pose < end; ++pose) {
    const int row = prepared.odometry_into[pose];
    const double* from = state->poses.row(odometry.from[row]).data();
    const double* relative = odometry.relative.row(row).data();
    double* to = state->poses.row(pose).data();
    if (prepared.graph.pose_model == PoseModel::kSe2) {
      Se2::Compose(from, relative, to);
    } else {
      Se3::Compose(from, relative, to);
    }
  }
}

}  // namespace dqslam
