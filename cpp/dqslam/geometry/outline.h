// The outline of an ellipsoid in the image, and the edges of its box that lie outside of the image.
#pragma once

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

/// The default number of points.  Chords of an outline 600 px wide are then off by 0.1 px at most.
inline constexpr int kOutlinePoints = 128;

/// Points of the outline [undistorted px], shape (points, 2).  The last point is the first one
/// again.  Returns false unless the ellipsoid is strictly in front.  The image of the dual quadric
/// is the dual conic p p^T - S, which is that of an ellipse.
bool ProjectToOutline(const Surface<double>& in_camera,
                      const Camera& camera,
                      int points,
                      RowMatrix* outline);

/// The edges of an ellipsoid's box that its outline touches outside the image, where no detector
/// can see it.  The box is that of ProjectToBox.
EdgeFlags EdgesOutOfSight(const Surface<double>& in_camera,
                          const Camera& camera,
                          const Eigen::Vector4d& box);

}  // namespace dqslam
