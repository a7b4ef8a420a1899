#include "dqslam/linear/layout_cache.h"

#include <algorithm>

namespace dqslam {
namespace {

using Pairs = std::vector<std::pair<int, int>>;

// The others are zero, but are eliminated like the rest.
constexpr double kMostBlocks = 1.05;

bool Serves(const BlockPattern& pattern, const std::vector<int>& sizes, const Pairs& pairs) {
  return pattern.sizes() == sizes && pattern.num_off_diagonal() <= kMostBlocks * pairs.size() &&
         std::all_of(pairs.begin(), pairs.end(), [&](const auto& pair) {
           return pattern.IndexOf(pair.first, pair.second) >= 0;
         });
}

}  // namespace

std::shared_ptr<const BlockPattern> LayoutCache::PatternOf(std::vector<int> sizes,
                                                           const Pairs& pairs) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!pattern_ || !Serves(*pattern_, sizes, pairs)) {
    pattern_ = std::make_shared<BlockPattern>(std::move(sizes), pairs);
  }
  return pattern_;
}

std::shared_ptr<const Elimination> LayoutCache::EliminationOf(
    const std::shared_ptr<const BlockPattern>& pattern) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (eliminated_ != pattern) {
    elimination_ = std::make_shared<Elimination>(*pattern);
    eliminated_ = pattern;
  }
  return elimination_;
}

}  // namespace dqslam
