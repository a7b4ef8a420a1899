// One track as a least-squares problem: its boxes, its motion, its size and the ground.
//
//   boxes    Student t distributions of kFreedom degrees, as weights of the squared errors
//   motion   CompareStates() between successive images, and a broad prior of the first state
//   size     a normal prior on the logarithms of the half sides
//   ground   in the boxes: states have heights above it
//
// The normal equations are a chain of 6 x 6 blocks, with a border for the size that all boxes
// share.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/tracks/motion.h"
#include "dqslam/tracks/upright_box.h"

namespace dqslam::tracks {

/// Boxes that do not fit are forgiven as errors of a Student t distribution of so many degrees.
inline constexpr double kFreedom = 4;
/// The Fisher information of four errors of this distribution, as a share of their mean weight in
/// the normal equations.
inline constexpr double kShareOfInformation = (kFreedom + 4) / (kFreedom + 6);

/// One image of the thing.
struct TrackImage {
  View view;
  double seconds;
  Eigen::Vector4d box;       ///< pixels of the pinhole
  Eigen::Vector4d variance;  ///< of each edge, pixels squared
  EdgeFlags truncated;       ///< edges beyond which the thing may go on
  LocalGround ground;
};

/// The boxes of one thing, one an image, and what is known of its kind beforehand.
struct TrackProblem {
  Camera camera;
  std::vector<TrackImage> images;  ///< in order of time
  Eigen::Vector3d log_half;        ///< middle of the prior on the half sides, log meters
  Eigen::Matrix3d size_precision;  ///< inverse of its covariance
  MotionNoise noise;
  /// Whether the ground is known in the frame of the camera, and goes where that goes.
  bool ground_follows;
};

/// Matrices of six columns, stacked.
using StateTable = Eigen::Matrix<double, Eigen::Dynamic, kStateSize, Eigen::RowMajor>;

struct Trajectory {
  StateTable state;          ///< a row for each image
  Eigen::Vector3d log_half;  ///< logarithms of half the length, width and height [m]
};

struct Equations {
  /// Half the sum of squares, after the loss: minus the log density, up to constants and the
  /// log density of motion and size.
  double cost = 0;
  double log_density = 0;  ///< of motion and size, what the cost lacks
  StateTable diagonal;     ///< (6 n, 6), blocks of the states
  StateTable below;        ///< (6 n - 6, 6), blocks of each state and the one before it
  StateTable of_boxes;     ///< (n, 6), what boxes add to the diagonal of the diagonal blocks
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> border;  ///< (6 n, 3)
  Eigen::Matrix3d corner;                                            ///< block of the size
  StateTable gradient;                                               ///< (n, 6)
  Eigen::Vector3d gradient_size;                                     ///< by the size
  StateTable by_camera;  ///< (9 n, 6), of each state, then the size, and the motion of its camera
  StateTable of_camera;  ///< (6 n, 6), of these motions
  StateTable gradient_camera;  ///< (n, 6), by these motions
  RowMatrix rest_by_state;     ///< (n - 1, 12), errors of heights at rest by both states
  RowMatrix rest_by_camera;    ///< (n - 1, 12), the same by the motions of both cameras
  Eigen::VectorXd chi2;        ///< of each box
};

/// Throws std::invalid_argument unless sizes agree and there are two images at least.
void RequireFit(const TrackProblem& problem, const Trajectory& at, const Mask& moves);

/// The normal equations at some states, or none where a box is undefined.  Throws as RequireFit()
/// does.
///   moves        between images, n - 1: the hypothesis
///   first        the middle of the prior of the first state
///   information  what the squared errors of boxes are multiplied by, beside their weights
std::optional<Equations> Linearize(const TrackProblem& problem,
                                   const Trajectory& at,
                                   const Mask& moves,
                                   const State& first,
                                   double information = 1);

}  // namespace dqslam::tracks
