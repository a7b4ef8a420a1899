// How things move on the ground: along their heading, with a speed and a turn rate that wander.
//
// A state is x, y [m], the height of the foot above the ground in sigmas, the heading [rad], the
// speed [m/s] along it, and the turn rate [rad/s].  Speed and turn rate change by white noise of a
// density.  What rests has neither speed nor turn rate.
#pragma once

#include <Eigen/Core>

namespace dqslam::tracks {

inline constexpr int kStateSize = 6;
enum StateIndex { kX, kY, kAbove, kHeading, kSpeed, kTurn };

using State = Eigen::Matrix<double, kStateSize, 1>;
using StateMatrix = Eigen::Matrix<double, kStateSize, kStateSize>;

/// How restlessly things of a kind move.
struct MotionNoise {
  double acceleration;  ///< density of the white acceleration, m/s^2 / sqrt(Hz)
  double turn;          ///< the same of the turn rate, rad/s^2 / sqrt(Hz)
  double slip;          ///< density of the motion across the heading, m / sqrt(s)
  double usual_speed;   ///< sigma of the speed of what moves, m/s
  double usual_turn;    ///< sigma of the turn rate of what moves, rad/s
};

/// The ground c + a x + b y as one image shows it.
struct LocalGround {
  Eigen::Vector3d plane;  ///< c, a, b
  double unit;            ///< what heights above it are in units of, meters

  double FootHeight(const State& state) const {
    return plane[0] + plane[1] * state[kX] + plane[2] * state[kY] + unit * state[kAbove];
  }
};

enum class StepKind {
  kMoves,
  kStops,  ///< rests at the later state, and has moved to the earlier one
  kRests,
};

/// The error of the motion between two states, in sigmas, and its derivatives.
struct MotionStep {
  State error;
  StateMatrix by_from, by_to;
  double log_density;  ///< logarithm of the determinant of what the error is whitened by
};

/// Compares two states with a motion over `seconds`.  What moves stays at its height above the
/// ground, as an image shows that; what rests stays where it is in the world, whatever the images
/// say of the ground.  `drift` is the density of the height above the ground, sigmas / sqrt(s).
MotionStep CompareStates(const State& from,
                         const State& to,
                         double seconds,
                         StepKind kind,
                         const MotionNoise& noise,
                         double drift,
                         const LocalGround& ground_from,
                         const LocalGround& ground_to);

/// Sigmas of the first state: anywhere, as fast as what moves, or rests, is.
State FirstSigmas(bool moves, const MotionNoise& noise);

}  // namespace dqslam::tracks
