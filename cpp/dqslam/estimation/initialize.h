// The start of an object, from its boxes and the cameras that observed it.
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
  /// Edges that the image border cut, and that are therefore not edges of the object.
  EdgeFlags truncated = EdgeFlags::Constant(false);
};

/// The paper's linear fit.  [S&M17] eqs. (9), (10)
struct SvdFit {
  Vector9d quadric;                              ///< of any signature
  Eigen::Matrix<double, 10, 1> singular_values;  ///< descending, of unit planes
  bool degenerate = false;  ///< the null space has several dimensions, as for planar motion
};

/// The right singular vector with the smallest singular value, of the equations of all planes
/// through edges.  For good conditioning, the planes have unit normals and are expressed in a frame
/// that is centered on the object and scaled by its distance.  Truncated edges are left out. Throws
/// std::invalid_argument for fewer than 3 views.
SvdFit FitSvd(const Camera& camera, const std::vector<View>& views);

/// The start of [S&M17]: (1, 0, 0, 0, 1, 0, 0, 1, 0), that is, Q* = I.  Its shape matrix is -I, so
/// it is not an ellipsoid.
Vector9d IdentityQuadric();

/// A sphere of the prior size.  Each view places it at the depth where it fits the box; the result
/// is the mean of these places.
Vector9d BackProject(const Camera& camera, const std::vector<View>& views, const SizePrior& prior);

/// The sphere with the smallest tangent residuals, with the size prior on its radius.  The problem
/// is linear in center and radius.  Falls back to BackProject where that sphere is not in front of
/// all cameras.
Vector9d FitSphere(const Camera& camera, const std::vector<View>& views, const SizePrior& prior);

}  // namespace dqslam
