#include "dqslam/costs/box_chi_square.h"

#include <limits>

#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/batch.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/geometry/outline.h"

namespace dqslam {

namespace {

template <typename Object>
double ChiSquare(const Object& in_camera,
                 const Camera& camera,
                 const Eigen::Vector4d& observed,
                 const EdgeFlags& truncated,
                 const Eigen::Matrix4d& sqrt_information) {
  Eigen::Vector4d predicted;
  if (!ProjectToBox(in_camera, camera, &predicted)) return std::numeric_limits<double>::infinity();
  Eigen::Vector4d error = predicted - observed;
  IgnoreBeyond(OneSidedEdges(truncated, camera, in_camera, predicted), &error);
  return (sqrt_information * error).squaredNorm();
}

}  // namespace

double BoxChiSquare(const Surface<double>& in_camera,
                    const Camera& camera,
                    const Eigen::Vector4d& observed,
                    const EdgeFlags& truncated,
                    const Eigen::Matrix4d& sqrt_information) {
  return ChiSquare(in_camera, camera, observed, truncated, sqrt_information);
}

double BoxChiSquare(const Body<double>& in_camera,
                    const Camera& camera,
                    const Eigen::Vector4d& observed,
                    const EdgeFlags& truncated,
                    const Eigen::Matrix4d& sqrt_information) {
  return ChiSquare(in_camera, camera, observed, truncated, sqrt_information);
}

Eigen::VectorXd BoxChiSquareRows(PoseModel model,
                                 const Camera& camera,
                                 const RowMatrix& poses,
                                 const RowMatrix& ellipsoids,
                                 const RowMatrix& boxes,
                                 const RowMatrix& covariances,
                                 const BoolTable& truncated) {
  const Eigen::Index rows = poses.rows();
  RequireShape("ellipsoids", ellipsoids, rows, kLandmarkSize);
  RequireShape("boxes", boxes, rows, kBoxSize);
  RequireShape("covariances", covariances, rows, kBoxSize * kBoxSize);
  RequireShape("truncated", truncated, rows, kBoxSize);
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("poses", poses, rows, Pose::kSize);
    const Mount mount(camera);
    Eigen::VectorXd chi_squares(rows);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const Surface<double> in_camera = ToCamera(LocateCamera<Pose>(poses.row(i).data(), mount),
                                                 EllipsoidModel::Unpack(ellipsoids.row(i).data()));
      chi_squares[i] = BoxChiSquare(in_camera,
                                    camera,
                                    boxes.row(i),
                                    truncated.row(i),
                                    SqrtInformationOfRow<kBoxSize>("covariances", covariances, i));
    }
    return chi_squares;
  });
}

}  // namespace dqslam
