// The geometry of poses and ellipsoids for tables, row by row.  Python calls these functions.
// All of them throw std::invalid_argument naming the table if shapes do not fit.
// If the result of a row is a matrix (r, c), the matrices of all rows are stacked: (n * r, c).
#pragma once

#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// Throws std::invalid_argument naming the table unless it has this shape.
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
/// The first pose and the poses that n relative poses lead to, shape (n + 1, d).
RowMatrix DeadReckonRows(PoseModel model, const Eigen::VectorXd& first, const RowMatrix& relative);
/// SE(3) poses of the camera, shape (n, 7).
RowMatrix WorldFromCameraRows(PoseModel model, const Camera& camera, const RowMatrix& poses);

/// Box of ellipsoid i from pose i [undistorted px], shape (n, 4), and whether the ellipsoid is
/// strictly in front.  The box is NaN if it is not.
std::pair<RowMatrix, Mask> ProjectToBoxesRows(PoseModel model,
                                              const Camera& camera,
                                              const RowMatrix& poses,
                                              const RowMatrix& ellipsoids);

/// The edges (n, 4) of these boxes that the outlines touch outside the image, see outline.h.
BoolTable EdgesOutOfSightRows(PoseModel model,
                              const Camera& camera,
                              const RowMatrix& poses,
                              const RowMatrix& ellipsoids);

/// The results of ProjectToBoxesRows, and the Jacobians of the boxes, stacked (4 n, k + 9): by the
/// tangent of the pose, then by the ellipsoid.  They are NaN unless it is strictly in front.
std::tuple<RowMatrix, Mask, RowMatrix> DifferentiateBoxesRows(PoseModel model,
                                                              const Camera& camera,
                                                              const RowMatrix& poses,
                                                              const RowMatrix& ellipsoids);

/// Outline of ellipsoid i from pose i [undistorted px], see outline.h, stacked (n * points, 2).  It
/// is NaN unless the ellipsoid is strictly in front.
RowMatrix ProjectToOutlinesRows(PoseModel model,
                                const Camera& camera,
                                const RowMatrix& poses,
                                const RowMatrix& ellipsoids,
                                int points);

/// Shapes S [m^2] of ellipsoids (n, 9), stacked (3 n, 3).
RowMatrix EllipsoidShapeRows(const RowMatrix& ellipsoids);
/// Shapes S [m^2] of dual quadrics (n, 9) of any signature, stacked (3 n, 3).
RowMatrix DualQuadricShapeRows(const RowMatrix& quadrics);

}  // namespace dqslam
