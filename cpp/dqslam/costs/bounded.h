// A prior that may be wrong: its residual is divided by sqrt(1 + |r|^2 / 9), which is the closed
// form of a switch (Geman & McClure), so that it costs 4.5 at most.
#pragma once

#include <cmath>

namespace dqslam {

inline constexpr double kSquaredBound = 9;

/// Bounds the norm of a residual by 3, as a switch does where it does not fit.
template <typename T>
void BoundBySwitch(int size, T* residual) {
  using std::sqrt;
  T squared(0);
  for (int i = 0; i < size; ++i) squared += residual[i] * residual[i];
  const T scale = T(1) / sqrt(T(1) + squared / T(kSquaredBound));
  for (int i = 0; i < size; ++i) residual[i] *= scale;
}

/// The norm of a residual before it was bounded.
inline double NormBeforeSwitch(double bounded) {
  return bounded / std::sqrt(1 - bounded * bounded / kSquaredBound);
}

}  // namespace dqslam
