#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "dqslam/online/schedule.h"

namespace dqslam::online {
namespace {

// The window of the last ten poses, fitting so well.
WindowFit Window(int end, double chi_square = 1, int undefined = 0) {
  return {end - 10, end, chi_square, undefined};
}

TEST(Schedule, LevelsOfALongSession) {
  Schedule schedule{OnlineOptions()};
  int short_ones = 0, medium_ones = 0, long_ones = 0, last_end = 0;
  for (int end = 1; end <= 4096; ++end) {
    const Smoothing smoothing = schedule.Choose(Window(end));
    EXPECT_FALSE(smoothing.closes_loop);
    if (smoothing.begin == end - 10) continue;
    if (end <= 640) continue;
    const int poses = end - smoothing.begin;
    if (poses == 64) {
      ++short_ones;
      EXPECT_EQ(end % 16, 0);
      EXPECT_EQ(smoothing.iterations, 5);
      continue;
    }
    EXPECT_EQ(end - last_end, last_end > 0 ? 128 : end);
    last_end = end;
    if (smoothing.iterations == 1) {
      ++long_ones;
      EXPECT_EQ(poses, std::min(end, 2048));
    } else {
      ++medium_ones;
      EXPECT_EQ(poses, 640);
      EXPECT_EQ(smoothing.iterations, 5);
    }
  }
  // 27 in 3456 steps, of which each fourth is a long one.
  EXPECT_EQ(medium_ones + long_ones, 27);
  EXPECT_NEAR(long_ones, 27 / 4.0, 1);
  EXPECT_GE(short_ones, 3456 / 16 - 27);
}

// A young session minimizes all of itself whenever it has grown by a quarter, at first each 16.
TEST(Schedule, MediumSmoothingsOfAYoungSession) {
  Schedule schedule{OnlineOptions()};
  std::vector<int> ends;
  for (int end = 1; end <= 128; ++end) {
    const Smoothing smoothing = schedule.Choose(Window(end));
    if (smoothing.begin == 0 && end > 10) ends.push_back(end);
  }
  EXPECT_EQ(ends, (std::vector<int>{16, 32, 48, 64, 80, 100, 125}));
}

TEST(Schedule, EachLevelHasItsNumbers) {
  OnlineOptions options;
  options.short_smoothing = {20, 7, 2};
  options.medium_smoothing = {50, 35, 3};
  options.long_smoothing = {90, 70, 4};
  Schedule schedule{options};
  std::vector<std::vector<int>> smoothings;  // end, poses, iterations
  for (int end = 1; end <= 191; ++end) {
    const Smoothing one = schedule.Choose(Window(end));
    if (end > 170 || one.iterations == 4)
      smoothings.push_back({end, end - one.begin, one.iterations});
  }
  smoothings.erase(
      std::remove_if(
          smoothings.begin(), smoothings.end(), [](const auto& one) { return one[1] == 10; }),
      smoothings.end());
  EXPECT_EQ(
      smoothings,
      (std::vector<std::vector<int>>{
          {80, 80, 4}, {156, 90, 4}, {175, 20, 2}, {182, 20, 2}, {189, 20, 2}, {191, 50, 3}}));
}

TEST(Schedule, ALoopThatDoesNotFitFreesAllPosesSinceItsObjectWasSeen) {
  Schedule schedule{OnlineOptions()};
  EXPECT_FALSE(schedule.WatchLoop(300, 428, 428));  // 128 poses are no absence
  EXPECT_FALSE(schedule.Choose(Window(429, 9)).closes_loop);
  EXPECT_TRUE(schedule.WatchLoop(300, 429, 429));
  EXPECT_TRUE(schedule.WatchLoop(200, 431, 431));  // another object, not seen for longer
  EXPECT_FALSE(schedule.Choose(Window(432)).closes_loop) << "all fits";
  const Smoothing smoothing = schedule.Choose(Window(433, 9));
  EXPECT_TRUE(smoothing.closes_loop);
  EXPECT_EQ(smoothing.begin, 200);
  EXPECT_EQ(smoothing.iterations, 10);
  EXPECT_FALSE(schedule.Choose(Window(434, 9)).closes_loop) << "it was closed";
}

TEST(Schedule, ALoopIsWatchedForAsLongAsAWindow) {
  Schedule schedule{OnlineOptions()};
  EXPECT_TRUE(schedule.WatchLoop(100, 300, 300));
  EXPECT_FALSE(schedule.Choose(Window(312, 9)).closes_loop);
  EXPECT_TRUE(schedule.WatchLoop(100, 400, 400));
  EXPECT_TRUE(schedule.Choose(Window(411, 9)).closes_loop);
}

TEST(Schedule, ALoopOfLateLabelsNeedsNoMisfitOfTheWindow) {
  Schedule schedule{OnlineOptions()};
  EXPECT_TRUE(schedule.WatchLoop(50, 290, 300));
  schedule.LoopDoesNotFit();
  EXPECT_EQ(schedule.Choose(Window(302)).begin, 50);
}

// Loops earn credit at the rate of medium smoothings, and can save three.
TEST(Schedule, LoopsAreRare) {
  Schedule schedule{OnlineOptions()};
  int closed = 0;
  for (int end = 1001; end <= 1256; ++end) {
    schedule.WatchLoop(500, end - 1, end - 1);
    closed += schedule.Choose(Window(end, 9)).closes_loop;
  }
  EXPECT_EQ(closed, 3);  // one at once, and one for each 128 steps
}

TEST(Schedule, WhatDoesNotFitStartsAgainEachEightSteps) {
  Schedule schedule{OnlineOptions()};
  EXPECT_FALSE(schedule.Recovers(Window(20, 3.0)));
  EXPECT_TRUE(schedule.Recovers(Window(21, 3.1)));
  EXPECT_FALSE(schedule.Recovers(Window(28, 3.1)));
  EXPECT_TRUE(schedule.Recovers(Window(29, 1.0, 1)));
}

}  // namespace
}  // namespace dqslam::online
