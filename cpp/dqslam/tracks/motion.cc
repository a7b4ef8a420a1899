#include "dqslam/tracks/motion.h"

#include <cmath>

namespace dqslam::tracks {
namespace {

// What rests moves by this share of the noise of what moves: next to nothing, and not singular.
constexpr double kStill = 1e-2;
// Sigmas of speed [m/s] and turn rate [rad/s] at rest.
constexpr double kStillSpeed = 0.02, kStillTurn = 0.01;
// Sigma of the first place along each axis.
constexpr double kAnywhereM = 100, kPi = 3.14159265358979323846;

// A row of an error that is by itself.
void Whiten(int row, double weight, MotionStep* step) {
  step->error[row] *= weight;
  step->by_from.row(row) *= weight;
  step->by_to.row(row) *= weight;
  step->log_density += std::log(weight);
}

// White noise of a rate, over dt, has the covariance q^2 [dt^3/3 dt^2/2; dt^2/2 dt] of the distance
// and the rate: the rate less what the distance says of it, 3 / (2 dt) of that, has half the sigma.
void WhitenPair(int distance, int rate, double q, double dt, MotionStep* step) {
  const double of_distance = 1.5 / dt;
  step->error[rate] -= of_distance * step->error[distance];
  step->by_from.row(rate) -= of_distance * step->by_from.row(distance);
  step->by_to.row(rate) -= of_distance * step->by_to.row(distance);
  Whiten(distance, std::sqrt(3 / (dt * dt * dt)) / q, step);
  Whiten(rate, 2 / (q * std::sqrt(dt)), step);
}

}  // namespace

MotionStep CompareStates(const State& from,
                         const State& to,
                         double seconds,
                         StepKind kind,
                         const MotionNoise& noise,
                         double drift,
                         const LocalGround& ground_from,
                         const LocalGround& ground_to) {
  const double dt = seconds, middle = from[kHeading] + 0.5 * dt * from[kTurn];
  const double cos = std::cos(middle), sin = std::sin(middle);
  const double dx = to[kX] - from[kX], dy = to[kY] - from[kY];
  const double along = cos * dx + sin * dy, across = cos * dy - sin * dx;
  MotionStep step;
  step.log_density = 0;
  step.error = to - from;
  step.error[kX] = along - dt * from[kSpeed];
  step.error[kY] = across;
  step.error[kHeading] -= dt * from[kTurn];
  step.by_to.setIdentity();
  step.by_from = -step.by_to;
  step.by_to.topLeftCorner<2, 2>() << cos, sin, -sin, cos;
  step.by_from.topLeftCorner<2, 2>() = -step.by_to.topLeftCorner<2, 2>();
  step.by_from.block<2, 1>(kX, kHeading) << across, -along;
  step.by_from.block<2, 1>(kX, kTurn) = 0.5 * dt * step.by_from.block<2, 1>(kX, kHeading);
  step.by_from(kX, kSpeed) = -dt;
  step.by_from(kHeading, kTurn) = -dt;
  if (kind != StepKind::kMoves) {  // the height in the world stays
    const double unit = ground_to.unit;
    step.error[kAbove] = (ground_to.FootHeight(to) - ground_from.FootHeight(from)) / unit;
    step.by_to.block<1, 2>(kAbove, kX) = ground_to.plane.tail<2>().transpose() / unit;
    step.by_from.block<1, 2>(kAbove, kX) = -ground_from.plane.tail<2>().transpose() / unit;
    step.by_from(kAbove, kAbove) = -ground_from.unit / unit;
  }
  const double share = kind == StepKind::kMoves ? 1 : kStill;
  Whiten(kY, 1 / (share * noise.slip * std::sqrt(dt)), &step);
  Whiten(kAbove, 1 / (share * drift * std::sqrt(dt)), &step);
  if (kind == StepKind::kStops) {  // the rates are those of rest, whatever they were
    for (const int rate : {kSpeed, kTurn}) {
      step.error[rate] = to[rate];
      step.by_from(rate, rate) = 0;
    }
    Whiten(kX, std::sqrt(3 / (dt * dt * dt)) / noise.acceleration, &step);
    Whiten(kSpeed, 1 / kStillSpeed, &step);
    Whiten(kHeading, std::sqrt(3 / (dt * dt * dt)) / noise.turn, &step);
    Whiten(kTurn, 1 / kStillTurn, &step);
  } else {
    WhitenPair(kX, kSpeed, share * noise.acceleration, dt, &step);
    WhitenPair(kHeading, kTurn, share * noise.turn, dt, &step);
  }
  return step;
}

State FirstSigmas(bool moves, const MotionNoise& noise) {
  State sigmas;
  sigmas << kAnywhereM, kAnywhereM, 1, kPi, moves ? noise.usual_speed : kStillSpeed,
      moves ? noise.usual_turn : kStillTurn;
  return sigmas;
}

}  // namespace dqslam::tracks
