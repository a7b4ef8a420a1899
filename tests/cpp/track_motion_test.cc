#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <utility>

#include "dqslam/tracks/motion.h"
#include "random.h"

namespace dqslam::tracks {
namespace {

constexpr double kStill = 1e-2;
const MotionNoise kCar{1.0, 0.15, 0.05, 12.0, 0.2};
const LocalGround kLevel{Eigen::Vector3d::Zero(), 1};

MotionStep Compare(const State& from, const State& to, double dt, StepKind kind) {
  return CompareStates(from, to, dt, kind, kCar, 0.3, kLevel, kLevel);
}

State At(double heading, double speed, double turn) {
  State state;
  state << 1, 2, 0.1, heading, speed, turn;
  return state;
}

// Along an arc, whose chord has the direction in the middle of the time.
State After(const State& from, double dt) {
  const double middle = from[kHeading] + 0.5 * dt * from[kTurn];
  State to = from;
  to[kX] += dt * from[kSpeed] * std::cos(middle);
  to[kY] += dt * from[kSpeed] * std::sin(middle);
  to[kHeading] += dt * from[kTurn];
  return to;
}

// Of a distance and its rate by white noise of the rate, over dt.
Eigen::Matrix2d WhiteNoise(double q, double dt) {
  Eigen::Matrix2d covariance;
  covariance << dt * dt * dt / 3, dt * dt / 2, dt * dt / 2, dt;
  return q * q * covariance;
}

TEST(Motion, AConstantOneHasNoError) {
  for (const double turn : {0.0, 0.4}) {
    const State from = At(0.3, 5, turn);
    EXPECT_LT(Compare(from, After(from, 0.2), 0.2, StepKind::kMoves).error.norm(), 1e-12);
  }
}

TEST(Motion, ErrorsAreInSigmasOfWhiteNoise) {
  const double dt = 0.2;
  const State from = At(0, 5, 0);
  for (const auto& [distance, speed] : {std::pair(0.0, 0.7), {0.05, 0.0}, {-0.1, 0.3}}) {
    State to = After(from, dt);
    to[kX] += distance;
    to[kSpeed] += speed;
    const Eigen::Vector2d off(distance, speed);
    const double expected = off.dot(WhiteNoise(kCar.acceleration, dt).inverse() * off);
    EXPECT_NEAR(Compare(from, to, dt, StepKind::kMoves).error.squaredNorm(), expected, 1e-9);
  }
}

TEST(Motion, LogDensityIsThatOfTheCovariances) {
  const double dt = 0.2;
  const double variances = WhiteNoise(kCar.acceleration, dt).determinant() *
                           WhiteNoise(kCar.turn, dt).determinant() * kCar.slip * kCar.slip * dt *
                           0.3 * 0.3 * dt;
  const State from = At(0.3, 5, 0);
  const MotionStep step = Compare(from, After(from, dt), dt, StepKind::kMoves);
  EXPECT_NEAR(step.log_density, -0.5 * std::log(variances), 1e-9);
}

TEST(Motion, DerivativesAreSmallDifferences) {
  Random random(0);
  const LocalGround before{random.UniformVector<3>(-0.1, 0.1), 0.3};
  const LocalGround after{random.UniformVector<3>(-0.1, 0.1), 0.4};
  const State from = random.UniformVector<6>(-1, 1), to = random.UniformVector<6>(-1, 1);
  constexpr double kStep = 1e-6;
  for (const StepKind kind : {StepKind::kMoves, StepKind::kStops, StepKind::kRests}) {
    const auto error = [&](const State& a, const State& b) {
      return CompareStates(a, b, 0.1, kind, kCar, 0.3, before, after).error;
    };
    const MotionStep step = CompareStates(from, to, 0.1, kind, kCar, 0.3, before, after);
    for (int column = 0; column < kStateSize; ++column) {
      const State move = kStep * State::Unit(column);
      const State by_from = (error(from + move, to) - error(from - move, to)) / (2 * kStep);
      const State by_to = (error(from, to + move) - error(from, to - move)) / (2 * kStep);
      const double scale = 1 + step.by_from.cwiseAbs().maxCoeff();
      EXPECT_LT((step.by_from.col(column) - by_from).norm(), 1e-7 * scale);
      EXPECT_LT((step.by_to.col(column) - by_to).norm(), 1e-7 * scale);
    }
  }
}

TEST(Motion, AtAStopTheSpeedIsThatOfRestWhateverItWas) {
  const State from = At(0, 2, 0), to = At(0, 0.04, 0);
  EXPECT_NEAR(Compare(from, to, 0.1, StepKind::kStops).error[kSpeed], 0.04 / 0.02, 1e-12);
}

TEST(Motion, WhatRestsHardlyMoves) {
  const State from = At(0.3, 0, 0);
  State to = from;
  to[kX] += 0.1;
  const State rests = Compare(from, to, 0.1, StepKind::kRests).error;
  const State moves = Compare(from, to, 0.1, StepKind::kMoves).error;
  EXPECT_LT((rests - moves / kStill).norm(), 1e-9 * rests.norm());
}

// The second image has the ground 0.3 m lower; heights are in units of 0.2 m.
TEST(Motion, WhatRestsKeepsItsHeightAndWhatMovesFollowsTheGround) {
  const LocalGround before{{0, 0, 0}, 0.2}, after{{-0.3, 0, 0}, 0.2};
  const auto error = [&](StepKind kind, double height) {
    const State from = State::Zero();
    State to = from;
    to[kAbove] = height;
    return CompareStates(from, to, 0.25, kind, kCar, 0.4, before, after).error[kAbove];
  };
  EXPECT_NEAR(error(StepKind::kMoves, 0), 0, 1e-12);
  EXPECT_NEAR(error(StepKind::kMoves, 1.5), 1.5 / (0.4 * 0.5), 1e-9);
  EXPECT_NEAR(error(StepKind::kRests, 1.5), 0, 1e-9);
  EXPECT_NEAR(error(StepKind::kRests, 0), -1.5 / (kStill * 0.4 * 0.5), 1e-9);
}

}  // namespace
}  // namespace dqslam::tracks
