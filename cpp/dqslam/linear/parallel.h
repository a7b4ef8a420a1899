// Work that several threads share.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>

namespace dqslam {

/// Calls work(i) once for each i in [0, count), with at most `threads` calls at a time, in any
/// order.  The calling thread takes part, and with one thread it makes all calls in ascending
/// order. If a call throws, no further calls begin, and one such exception is thrown here when the
/// others have returned.
void ParallelFor(int threads, int count, const std::function<void(int)>& work);

/// Calls work(begin, end) for successive parts of [0, count), in the same way.
template <typename Work>
void ParallelForParts(int threads, std::ptrdiff_t count, std::ptrdiff_t part, const Work& work) {
  const auto parts = static_cast<int>((count + part - 1) / part);
  ParallelFor(threads, parts, [&](int i) { work(i * part, std::min(count, (i + 1) * part)); });
}

}  // namespace dqslam
