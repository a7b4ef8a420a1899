// The geometry of poses and ellipsoids for tables, row by row: what Python calls.
// All of them throw std::invalid_argument naming the table when shapes do not fit.
// Where the result of a row is a matrix, those of all rows are stacked: (n * r, c).
#pragma once

#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// Throws std::invalid_argument naming the table unless it has a shape.
template <typename Table>
void RequireShape(const std::string& name,
                  const Table& table,
                  Eigen::Index rows,
                  Eigen::Index columns) {
  if (table.rows() == rows && table.cols() == columns) return;
  throw std::invalid_argument(name + " has shape (" + std::to_string(table.rows()) + ", " +
                              std::to_string(table.cols()) + "), expected (" +
                              std::to_string(rows) + ", " + std::to_string(columns) + ")");
}

/// a_from_c = a_from_b o b_from_c, shapes (n, d).
RowMatrix ComposeRows(PoseModel model, const RowMatrix& a_from_b, const RowMatrix& b_from_c);
/// b_from_c = a_from_b^-1 o a_from_c, shapes (n, d).
RowMatrix BetweenRows(PoseModel model, const RowMatrix& a_from_b, const RowMatrix& a_from_c);
/// b_from_a = a_from_b^-1, shape (n, d).
RowMatrix InverseRows(PoseModel model, const RowMatrix& a_from_b);
/// Adjoints of poses, see pose.h, stacked (n * k, k).
RowMatrix AdjointRows(PoseModel model, const RowMatrix& a_from_b);
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

/// Edges of the same boxes that the image does not show, see outline.h, shape (n, 4).
BoolTable EdgesOutOfSightRows(PoseModel model,
                              const Camera& camera,
                              const RowMatrix& poses,
                              const RowMatrix& ellipsoids);

/// What ProjectToBoxesRows returns, and Jacobians of the boxes by the tangent of the pose, then by
/// the ellipsoid, stacked (4 n, k + 9); NaN where it is not strictly in front.
std::tuple<RowMatrix, Mask, RowMatrix> DifferentiateBoxesRows(PoseModel model,
                                                              const Camera& camera,
                                                              const RowMatrix& poses,
                                                              const RowMatrix& ellipsoids);

/// Outline of ellipsoid i from pose i [undistorted px], see outline.h, stacked (n * points, 2); NaN
/// where it is not strictly in front.
RowMatrix ProjectToOutlinesRows(PoseModel model,
                                const Camera& camera,
                                const RowMatrix& poses,
                                const RowMatrix& ellipsoids,
                                int points);

/// Shapes S [m^2] of ellipsoids, and of dual quadrics of any signature, (n, 9); stacked (3 n, 3).
RowMatrix EllipsoidShapeRows(const RowMatrix& ellipsoids);
RowMatrix DualQuadricShapeRows(const RowMatrix& quadrics);

}  // namespace dqslam
