// AutoDiff with respect to tangents, for every cost that has no derivatives by hand.  It uses the
// same functors as Ceres, with jets that move along the tangents of their poses.
#pragma once

#include <ceres/jet.h>

#include <array>
#include <tuple>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

/// The parameters of a pose.  Its jets move along its tangent.
template <typename Pose>
struct PoseParameters {
  static constexpr int kSize = Pose::kSize;
  static constexpr int kTangentSize = Pose::kTangentSize;
  const double* values;

  /// The derivative columns of the tangent begin at `column`.
  template <typename Jet>
  std::array<Jet, kSize> Jets(int column) const {
    std::array<Jet, kSize> origin, moved;
    std::array<Jet, kTangentSize> tangent;
    for (int i = 0; i < kSize; ++i) origin[i] = Jet(values[i]);
    for (int i = 0; i < kTangentSize; ++i) tangent[i] = Jet(0.0, column + i);
    Plus<Pose>(origin.data(), tangent.data(), moved.data());
    return moved;
  }
};

/// Parameters that are their own tangent.
template <int kLength>
struct PlainParameters {
  static constexpr int kSize = kLength;
  static constexpr int kTangentSize = kLength;
  const double* values;

  template <typename Jet>
  std::array<Jet, kSize> Jets(int column) const {
    std::array<Jet, kSize> jets;
    for (int i = 0; i < kSize; ++i) jets[i] = Jet(values[i], column + i);
    return jets;
  }
};

/// The parameters of an object, and a number that objects share.
using ObjectParameters = PlainParameters<kLandmarkSize>;
using SharedParameters = PlainParameters<1>;

/// Residual of a cost, and its Jacobian by the tangents of its blocks, side by side in their order.
/// Returns false if the cost fails.
template <typename Cost, int kColumns, typename... Parameters>
bool Differentiate(const Cost& cost,
                   Eigen::Matrix<double, Cost::kResidualSize, 1>* residual,
                   Eigen::Matrix<double, Cost::kResidualSize, kColumns>* jacobian,
                   const Parameters&... blocks) {
  static_assert(kColumns == (Parameters::kTangentSize + ...));
  using Jet = ceres::Jet<double, kColumns>;
  int column = 0;
  const auto jets_of = [&column](const auto& block) {
    const int first = column;
    column += block.kTangentSize;
    return block.template Jets<Jet>(first);
  };
  // Braces evaluate the blocks in their order.
  const std::tuple<std::array<Jet, Parameters::kSize>...> parameters{jets_of(blocks)...};
  std::array<Jet, Cost::kResidualSize> jets;
  const bool defined = std::apply(
      [&](const auto&... block) { return cost(block.data()..., jets.data()); }, parameters);
  if (!defined) return false;
  for (int i = 0; i < Cost::kResidualSize; ++i) {
    (*residual)[i] = jets[i].a;
    jacobian->row(i) = jets[i].v.transpose();
  }
  return true;
}

}  // namespace dqslam
