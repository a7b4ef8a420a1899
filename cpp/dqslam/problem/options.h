// What a caller may choose.  Every default lives here and nowhere else.
#pragma once

#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

enum class Mode {
  kSlam,     ///< poses and objects are unknown; the first pose is fixed
  kMapping,  ///< poses are known and fixed, as in Rubino et al. 2017
};

enum class Residual {
  kAlgebraic,            ///< l^T P Q* P^T l, as published
  kAlgebraicNormalized,  ///< the same, divided by (P Q* P^T)_33
  kTangent,              ///< distance to the planes behind the edges
  kBox,                  ///< edges of the exact bounding box, in pixels
  kTangentThenBox,       ///< tangent to get there, box to finish
};

enum class Start {
  kIdentity,   ///< [S&M17]: Q* = I; for the ellipsoid model the unit sphere at the origin
  kSvd,        ///< [S&M17] eqs. (9), (10); where it is no ellipsoid, the sphere
  kSizePrior,  ///< back-projected to the depth at which the prior size fits the box
  kSphere,     ///< linear in center and radius, from the tangent residual
};

enum class Schedule {
  kBatch,  ///< all poses at once, from the initial poses
  kGrow,   ///< a few poses at a time along the trajectory
};

/// Robust back ends, on whole boxes; odometry is always quadratic.
enum class Loss {
  kNone,
  kHuber,
  kCauchy,
  kDcs,         ///< dynamic covariance scaling, Agarwal et al. 2013
  kSwitchable,  ///< switchable constraints, Suenderhauf & Protzel 2012
  kGncTls,      ///< graduated non-convexity, truncated least squares, Yang et al. 2020
  kGncGm,       ///< graduated non-convexity, Geman-McClure, Yang et al. 2020
};

enum class Minimizer { kLevenbergMarquardt, kDogleg };

/// Who carries out the steps; the costs and the methods are the same.
enum class Backend {
  kNative,  ///< normal equations in blocks, boxes differentiated by hand
  kCeres,   ///< ceres::Solve on AutoDiff cost functions: slower, a second opinion
};

/// 99 % and 99.9 % of chi-square with four degrees of freedom, the edges of a box.
inline constexpr double kBoxChiSquare99 = 13.28, kBoxChiSquare999 = 18.47;

struct SolveOptions {
  Mode mode = Mode::kSlam;
  Residual residual = Residual::kTangentThenBox;
  LandmarkModel landmark_model = LandmarkModel::kEllipsoid;
  Start start = Start::kSphere;
  Schedule schedule = Schedule::kGrow;
  Loss loss = Loss::kNone;
  double loss_scale = 2.0;                      ///< of Huber and Cauchy: sigmas of a whole box
  double outlier_chi_square = kBoxChiSquare99;  ///< of the others
  double algebraic_sigma = 1.0;                 ///< of both algebraic residuals, their own unit
  Backend backend = Backend::kNative;
  Minimizer minimizer = Minimizer::kDogleg;  ///< of the last stage
  int max_iterations = 300;                  ///< of each batch stage
  double function_tolerance = 1e-7;          ///< stop when |change of cost| / cost falls below
  int grow_poses = 64;                       ///< poses added at a time, or more:
  double grow_rotation = 0.25;               ///< while odometry's own sigma is below, radians
  int grow_iterations = 10;                  ///< Levenberg-Marquardt steps after each addition
  double grow_tolerance = 1e-2;              ///< function tolerance of these steps
  int grow_min_views = 8;                    ///< boxes an object needs before it is started
};

}  // namespace dqslam
