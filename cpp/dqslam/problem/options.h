// The options of a solve.  Their defaults are defined here and nowhere else.
#pragma once

#include <functional>
#include <stdexcept>

#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

enum class Mode {
  kSlam,     ///< poses and objects are unknown; the first pose is fixed
  kMapping,  ///< poses are known and fixed, as in Rubino et al. 2017
};

enum class Residual {
  kAlgebraic,            ///< l^T P Q* P^T l, as published
  kAlgebraicNormalized,  ///< the algebraic residual, divided by (P Q* P^T)_33
  kTangent,              ///< distance of the ellipsoid to the planes through the edges
  kBox,                  ///< edges of the exact bounding box, in pixels
  kTangentThenBox,       ///< tangent residuals in the first stages, box residuals in the last one
};

enum class Start {
  kIdentity,   ///< Q* = I as in [S&M17]; for the ellipsoid model, the unit sphere at the origin
  kSvd,        ///< [S&M17] eqs. (9), (10); kSphere where the result is not an ellipsoid
  kSizePrior,  ///< a sphere of the prior size, at the depth where it fits the box
  kSphere,     ///< the sphere with the smallest tangent residuals, from a linear problem
};

enum class Schedule {
  kBatch,  ///< all poses at once, from the initial poses
  kGrow,   ///< a few poses at a time along the trajectory
};

/// Robust losses.  They apply to whole boxes; odometry is always quadratic.
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

/// The solver that minimizes a stage.  Costs and methods are the same in both.
enum class Backend {
  /// This library's solver, with block-sparse normal equations and derivatives of boxes by hand.
  /// Ceres still minimizes stages with an algebraic residual, dual quadrics or switchable
  /// constraints.
  kNative,
  kCeres,  ///< ceres::Solve on AutoDiff cost functions for every stage: slower, for comparison
};

/// 99 % and 99.9 % of chi-square with four degrees of freedom, the edges of a box.
inline constexpr double kBoxChiSquare99 = 13.28, kBoxChiSquare999 = 18.47;

struct SolveOptions {
  Mode mode = Mode::kSlam;
  Residual residual = Residual::kTangentThenBox;
  LandmarkModel landmark_model = LandmarkModel::kEllipsoid;
  Start start = Start::kSphere;
  Schedule schedule = Schedule::kGrow;
  /// The default survives wrong ids and false boxes.  Where all boxes fit, it ends with the plain
  /// sum of squares.
  Loss loss = Loss::kGncTls;
  /// Scale of the Huber and Cauchy losses, in sigmas of a whole box.
  double loss_scale = 2.0;
  /// A box whose chi-square exceeds this is an outlier.  It is the threshold of all robust losses
  /// but Huber and Cauchy.  The default is the 99.9 % quantile with 4 degrees of freedom.
  double outlier_chi_square = kBoxChiSquare999;
  /// Sigma of both algebraic residuals, in the unit of the residual.
  double algebraic_sigma = 1.0;
  Backend backend = Backend::kNative;
  Minimizer minimizer = Minimizer::kDogleg;  ///< the minimizer of the last stage
  int max_iterations = 300;                  ///< the most iterations of each batch stage
  /// A batch stage stops when |change of cost| / cost is at most this.
  double function_tolerance = 1e-7;
  /// Growing adds at least this number of poses at a time.
  int grow_poses = 8;
  /// Growing adds more than grow_poses poses as long as odometry predicts the directions of objects
  /// with at most this sigma, in radians.
  double grow_angle = 0.25;
  int grow_iterations = 10;  ///< the most Levenberg-Marquardt iterations after each addition
  /// The minimization after an addition stops when |change of cost| / cost is at most this.
  double grow_tolerance = 1e-2;
  /// Growing starts an object when it has this number of boxes.  The last addition starts all.
  int grow_min_views = 8;
  /// The most threads that work at a time.  The result has the same bits with any number.  Ceres
  /// uses one.
  int threads = 1;
};

/// Called once an iteration; false asks to stop.
using Monitor = std::function<bool()>;

/// Thrown when a monitor asked to stop.
struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted") {}
};

}  // namespace dqslam
