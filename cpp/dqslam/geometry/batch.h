// The geometry of pose.h and ellipsoid.h for tables, row by row: what Python calls.
// All of them throw std::invalid_argument naming the table when shapes do not fit.
#pragma once

#include <utility>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// a_from_c = a_from_b o b_from_c, shapes (n, d).
RowMatrix ComposeRows(PoseModel model, const RowMatrix& a_from_b, const RowMatrix& b_from_c);
/// b_from_c = a_from_b^-1 o a_from_c, shapes (n, d).
RowMatrix BetweenRows(PoseModel model, const RowMatrix& a_from_b, const RowMatrix& a_from_c);
/// pose (+) tangent, shapes (n, d) and (n, k).
RowMatrix PlusRows(PoseModel model, const RowMatrix& poses, const RowMatrix& tangents);
/// pose (-) origin, shape (n, k).
RowMatrix MinusRows(PoseModel model, const RowMatrix& poses, const RowMatrix& origins);
/// The chain of relative poses behind the first, shape (n + 1, d).
RowMatrix DeadReckonRows(PoseModel model, const Eigen::VectorXd& first, const RowMatrix& relative);
/// SE(3) poses of the camera, shape (n, 7).
RowMatrix WorldFromCameraRows(PoseModel model, const Camera& camera, const RowMatrix& poses);

/// Box of ellipsoid i from pose i [undistorted px], shape (n, 4), and whether it is strictly in
/// front; NaN where it is not.
std::pair<RowMatrix, Mask> ProjectToBoxesRows(PoseModel model,
                                              const Camera& camera,
                                              const RowMatrix& poses,
                                              const RowMatrix& ellipsoids);

}  // namespace dqslam
