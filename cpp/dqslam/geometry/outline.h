// The outline of an ellipsoid in the image, and how much of it the image shows.
#pragma once

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

/// By default an outline 600 px across is off by 0.1 px at most between two of its points.
inline constexpr int kOutlinePoints = 128;

/// Points of the outline [undistorted px], (points, 2), the last one the first again; false unless
/// the ellipsoid is strictly in front.  The image of the dual quadric is the dual conic p p^T - S,
/// that of an ellipse.
bool ProjectToOutline(const Surface<double>& in_camera,
                      const Camera& camera,
                      int points,
                      RowMatrix* outline);

/// Edges of an ellipsoid's box that its outline touches outside the image, where no detector sees
/// it.  The box is that of ProjectToBox.
EdgeFlags EdgesOutOfSight(const Surface<double>& in_camera,
                          const Camera& camera,
                          const Eigen::Vector4d& box);

}  // namespace dqslam
