// Parameter blocks and the conventions of all files.
//
//   frames      Transforms are `target_from_source`, quantities `x_in_frame`.
//               Camera: x right, y down, z forward.  Robot: x forward, y left, z up.
//   SE(2) pose  [x, y, theta]: world_from_robot, meters and radians.
//   SE(3) pose  [tx, ty, tz, qx, qy, qz, qw]: world_from_robot, unit quaternion.
//   tangent     Translation first, then rotation [rad], both in the frame of the pose itself:
//               plus(pose, d) = pose o (d_translation, Exp(d_rotation)).
//   ellipsoid   [cx, cy, cz, log l00, log l11, log l22, l10, l20, l21]: center and log-Cholesky
//               factor of the shape S = L L^T [m^2], in the world.
//   quadric     [q1 .. q9]: upper triangle of Q*, row by row, with Q*(4,4) = 1.  [S&M17] eq. (2)
//   box         [u_min, v_min, u_max, v_max], pixels.  Whole numbers are pixel centers, so the
//               image spans [-0.5, width - 0.5] x [-0.5, height - 0.5].
//
// [S&M17] is Suenderhauf & Milford, "Dual Quadrics from Object Detection Bounding Boxes as
// Landmark Representations in SLAM", 2017.
#pragma once

#include <Eigen/Core>

namespace dqslam {

inline constexpr int kLandmarkSize = 9;  ///< size of an ellipsoid and of a dual quadric
inline constexpr int kBoxSize = 4;

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;
template <typename T>
using Vector4 = Eigen::Matrix<T, 4, 1>;
template <typename T>
using Matrix3 = Eigen::Matrix<T, 3, 3>;
using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

/// A table: one row per item.
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using IndexVector = Eigen::VectorXi;
using BoolTable = Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Mask = Eigen::Array<bool, Eigen::Dynamic, 1>;
/// One flag for each edge of a box, in the order of its coordinates.
using EdgeFlags = Eigen::Array<bool, kBoxSize, 1>;

}  // namespace dqslam
