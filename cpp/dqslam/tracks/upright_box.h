// The box of a cuboid that stands upright, and its derivatives, by hand.
//
// A cuboid stands on its foot, the middle of its lower face, and is turned about the vertical by
// its heading, along which its length is.  A box reaches to the outermost of its eight corners.
// Where two of them are within a pixel, the edge is between them: it changes smoothly from one to
// the other, as at a car, whose corners are round, and an estimate does not get caught at the kink.
#pragma once

#include <Eigen/Core>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"

namespace dqslam::tracks {

/// An edge is the mean of the corners, each weighted by exp(its pixels outward / this).
inline constexpr double kRoundedPx = 0.5;

struct UprightCuboid {
  Eigen::Vector3d foot;  ///< meters, in a frame whose third axis is up
  double heading;        ///< about that axis, radians
  Eigen::Vector3d half;  ///< half the length, width and height, meters
};

/// Where a camera is in such a frame.
struct View {
  Eigen::Matrix3d rotation;  ///< of the camera's axes in the frame
  Eigen::Vector3d position;  ///< meters
};

/// Edges have the order of a box, and a row each.
struct UprightBox {
  Eigen::Vector4d box;  ///< pixels, of the corners in front of the camera; NaN where none is
  bool in_front;        ///< whether any corner is in front of the camera
  bool is_whole;        ///< whether all corners are
  Eigen::Matrix<double, 4, 2> corner;     ///< the corner that the edge touches, pixels
  Eigen::Matrix<double, 4, 4> by_place;   ///< by foot [m] and heading [rad]
  Eigen::Matrix<double, 4, 3> by_size;    ///< by the logarithms of the half sides
  Eigen::Matrix<double, 4, 6> by_camera;  ///< by a small motion of the camera in its frame [m, rad]
};

UprightBox PredictBox(const Camera& camera, const View& view, const UprightCuboid& cuboid);

}  // namespace dqslam::tracks
