#include "dqslam/linear/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace dqslam {
namespace {

TEST(ParallelFor, CallsOnceForEach) {
  for (const int threads : {0, 1, 2, 3, 20}) {
    for (const int count : {0, 1, 2, 7, 1000}) {
      std::vector<int> calls(count, 0);
      ParallelFor(threads, count, [&](int i) { ++calls[i]; });
      EXPECT_EQ(calls, std::vector<int>(count, 1)) << threads << " threads";
    }
  }
}

TEST(ParallelFor, OneThreadKeepsTheOrder) {
  std::vector<int> order, expected(100);
  std::iota(expected.begin(), expected.end(), 0);
  ParallelFor(1, 100, [&](int i) { order.push_back(i); });
  EXPECT_EQ(order, expected);
}

TEST(ParallelFor, ThrowsInTheCallerAndStops) {
  for (const int threads : {1, 2, 3}) {
    std::atomic<int> calls{0};
    const auto work = [&](int i) {
      ++calls;
      if (i == 5) throw std::out_of_range("five");
    };
    try {
      ParallelFor(threads, 1000000, work);
      FAIL() << "no exception";
    } catch (const std::out_of_range& error) {
      EXPECT_STREQ(error.what(), "five");
    }
    EXPECT_GE(calls, 6);
    EXPECT_LT(calls, threads == 1 ? 7 : 1000000);
  }
}

TEST(ParallelForParts, CoversTheRange) {
  for (const std::ptrdiff_t count : {0, 1, 9, 10, 11, 35}) {
    std::vector<int> calls(count, 0);
    ParallelForParts(3, count, 10, [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
      EXPECT_EQ(begin % 10, 0);
      EXPECT_LE(end - begin, 10);
      for (std::ptrdiff_t i = begin; i < end; ++i) ++calls[i];
    });
    EXPECT_EQ(calls, std::vector<int>(count, 1));
  }
}

}  // namespace
}  // namespace dqslam
