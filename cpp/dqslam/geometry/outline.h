// The outline of an ellipsoid in the image, and the edges of an object's box that lie outside.
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

/// The edges of an object's box that it touches outside the image, where no detector can see it.
/// The object is a Surface or a Body, and the box is that of its ProjectToBox.
template <typename Object>
EdgeFlags EdgesOutOfSight(const Object& in_camera,
                          const Camera& camera,
                          const Eigen::Vector4d& box) {
  const Eigen::Matrix<double, kBoxSize, 2> points = TouchingPoints(in_camera, camera, box);
  EdgeFlags out_of_sight;
  for (int edge = 0; edge < kBoxSize; ++edge) {
    out_of_sight[edge] = !camera.Shows(points(edge, 0), points(edge, 1));
  }
  return out_of_sight;
}

/// Edges of a box that only bound the object: those that the image border cut and, on boxes with
/// such an edge, those that `in_camera` touches outside the image, where the detector could not see
/// it.  The box `predicted` is that of ProjectToBox.
template <typename Object>
EdgeFlags OneSidedEdges(const EdgeFlags& truncated,
                        const Camera& camera,
                        const Object& in_camera,
                        const Eigen::Vector4d& predicted) {
  if (!truncated.any()) return truncated;
  return truncated || EdgesOutOfSight(in_camera, camera, predicted);
}

}  // namespace dqslam
