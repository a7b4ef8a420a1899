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

TEST(Schedule, LapsAndToursOfALongSession) {
  Schedule schedule{OnlineOptions()};
  int recent = 0, laps = 0, tours = 0, last_lap = 0;
  for (int end = 1; end <= 4096; ++end) {
    const Smoothing smoothing = schedule.Choose(Window(end));
    EXPECT_FALSE(smoothing.closes_loop);
    if (smoothing.begin == end - 10) continue;
    if (end <= 640) continue;
    const int poses = end - smoothing.begin;
    if (poses == 64) {
      ++recent;
      EXPECT_EQ(end % 16, 0);
      EXPECT_EQ(smoothing.iterations, 5);
      continue;
    }
    EXPECT_EQ(end - last_lap, last_lap > 0 ? 128 : end);
    last_lap = end;
    if (smoothing.iterations == 1) {
      ++tours;
      EXPECT_EQ(poses, std::min(end, 2048));
    } else {
      ++laps;
      EXPECT_EQ(poses, 640);
      EXPECT_EQ(smoothing.iterations, 5);
    }
  }
  // 27 in 3456 steps, of which each fourth is a tour.
  EXPECT_EQ(laps + tours, 27);
  EXPECT_NEAR(tours, 27 / 4.0, 1);
  EXPECT_GE(recent, 3456 / 16 - 27);
}

// A young session minimizes all of itself whenever it has grown by a quarter, at first each 16.
TEST(Schedule, LapsOfAYoungSession) {
  Schedule schedule{OnlineOptions()};
  std::vector<int> laps;
  for (int end = 1; end <= 128; ++end) {
    const Smoothing smoothing = schedule.Choose(Window(end));
    if (smoothing.begin == 0 && end > 10) laps.push_back(end);
  }
  EXPECT_EQ(laps, (std::vector<int>{16, 32, 48, 64, 80, 100, 125}));
}

TEST(Schedule, LapsAreShorterWhereManyObjectsAre) {
  Schedule schedule{OnlineOptions()};
  schedule.SmoothedWith(640, 80);  // twice as many as a lap has room for: a quarter of the poses
  EXPECT_EQ(1000 - schedule.Choose(Window(1000)).begin, 512);
  EXPECT_EQ(1128 - schedule.Choose(Window(1128)).begin, 160);
  schedule.SmoothedWith(640, 1000);  // never fewer than are recent
  EXPECT_EQ(1256 - schedule.Choose(Window(1256)).begin, 64);
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

TEST(Schedule, ALoopThatWasToldLateNeedsNoMisfitOfTheWindow) {
  Schedule schedule{OnlineOptions()};
  EXPECT_TRUE(schedule.WatchLoop(50, 290, 300));
  schedule.LoopDoesNotFit();
  EXPECT_EQ(schedule.Choose(Window(302)).begin, 50);
}

// Loops earn credit at the rate of laps, and can save three.
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
