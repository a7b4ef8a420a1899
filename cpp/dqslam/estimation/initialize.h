// Where an object starts, from its boxes and the cameras that saw it.
#pragma once

#include <vector>

#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/problem/graph.h"

namespace dqslam {

/// One box of an object.
struct View {
  CameraInWorld<double> camera;
  Eigen::Vector4d box;               ///< pixels
  Eigen::Matrix4d sqrt_information;  ///< 1 / pixels
  /// Edges that say nothing about where the object ends.
  EdgeFlags truncated = EdgeFlags::Constant(false);
};

/// The paper's linear fit.  [S&M17] eqs. (9), (10)
struct SvdFit {
  Vector9d quadric;                              ///< of any signature
  Eigen::Matrix<double, 10, 1> singular_values;  ///< descending, of unit planes
  bool degenerate = false;  ///< the null space is not one vector: planar motion does that
};

/// Smallest right singular vector of the planes' equations, normalized: planes of unit normal in a
/// frame that is centered on the object and scaled by its distance.  Throws std::invalid_argument
/// with fewer than 3 views.  Truncated edges take no part.
SvdFit FitSvd(const Camera& camera, const std::vector<View>& views);

/// [S&M17]: (1, 0, 0, 0, 1, 0, 0, 1, 0), that is Q* = I.  Its shape is -I: no ellipsoid.
Vector9d IdentityQuadric();

/// Sphere of the prior size at the depth where it fits the boxes; mean of the views.
Vector9d BackProject(const Camera& camera, const std::vector<View>& views, const SizePrior& prior);

/// Sphere whose tangent residuals are smallest: linear in center and radius, with the size prior on
/// the radius.  Falls back to BackProject where that sphere is not in front of all cameras.
Vector9d FitSphere(const Camera& camera, const std::vector<View>& views, const SizePrior& prior);

}  // namespace dqslam
