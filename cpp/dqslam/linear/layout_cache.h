// The layout of the last matrix, for a next one of the same pattern.
#pragma once

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "dqslam/linear/block_pattern.h"
#include "dqslam/linear/elimination.h"

namespace dqslam {

/// To order a large matrix takes about as long as to factorize it, and the stages of a solve mostly
/// couple the same blocks, or some less where boxes were thrown out.  Threads may share a cache.
class LayoutCache {
 public:
  /// The last pattern, if it has these blocks and few others, else a new one.  Throws like
  /// BlockPattern.
  std::shared_ptr<const BlockPattern> PatternOf(std::vector<int> sizes,
                                                const std::vector<std::pair<int, int>>& pairs);
  /// The last elimination, if it is of this very pattern, else a new one.
  std::shared_ptr<const Elimination> EliminationOf(
      const std::shared_ptr<const BlockPattern>& pattern);

 private:
  std::mutex mutex_;
  std::shared_ptr<const BlockPattern> pattern_, eliminated_;
  std::shared_ptr<const Elimination> elimination_;
};

}  // namespace dqslam
