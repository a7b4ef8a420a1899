#include "dqslam/costs/box_chi_square.h"

#include <limits>

#include "dqslam/costs/whitening.h"
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

template <typename Objects>
Eigen::VectorXd ChiSquares(PoseModel model,
                           const Camera& camera,
                           const RowMatrix& poses,
                           const Objects& objects,
                           const RowMatrix& boxes,
                           const RowMatrix& covariances,
                           const BoolTable& truncated) {
  const Eigen::Index rows = poses.rows();
  RequireShape("boxes", boxes, rows, kBoxSize);
  RequireShape("covariances", covariances, rows, kBoxSize * kBoxSize);
  RequireShape("truncated", truncated, rows, kBoxSize);
  Eigen::VectorXd chi_squares(rows);
  ForEachInCamera(model, camera, poses, objects, [&](Eigen::Index i, const auto& in_camera) {
    chi_squares[i] = ChiSquare(in_camera,
                               camera,
                               Eigen::Vector4d(boxes.row(i)),
                               EdgeFlags(truncated.row(i)),
                               SqrtInformationOfRow<kBoxSize>("covariances", covariances, i));
  });
  return chi_squares;
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
  return ChiSquares(model, camera, poses, ellipsoids, boxes, covariances, truncated);
}

Eigen::VectorXd BoxChiSquareRows(PoseModel model,
                                 const Camera& camera,
                                 const RowMatrix& poses,
                                 const BodyTable& bodies,
                                 const RowMatrix& boxes,
                                 const RowMatrix& covariances,
                                 const BoolTable& truncated) {
  return ChiSquares(model, camera, poses, bodies, boxes, covariances, truncated);
}

}  // namespace dqslam
