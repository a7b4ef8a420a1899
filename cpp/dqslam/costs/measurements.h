// The kinds of measurements between a pose and an object, other than boxes.  A kind is a cost with
// the blocks world_from_robot [d] and landmark [9], a name, and two members: the measured value and
// the square root of its information.  A cost that is added to this list works in batch, in Ceres,
// in covariances and in sessions.
#pragma once

#include <string>
#include <tuple>

#include "dqslam/costs/range.h"
#include "dqslam/costs/relative_position.h"

namespace dqslam {

template <typename Pose, typename Landmark>
using MeasurementCosts =
    std::tuple<RelativePositionCost<Pose, Landmark>, RangeCost<Pose, Landmark>>;

inline constexpr int kNumMeasurementKinds =
    std::tuple_size_v<MeasurementCosts<Se2, EllipsoidModel>>;

/// Carries the type of a cost to a visitor.
template <typename Cost_>
struct MeasurementTag {
  using Cost = Cost_;
};

/// Calls visit(MeasurementTag<Cost>{}) with the cost of a kind, which is an index into the list.
template <typename Pose, typename Landmark, int kFirst = 0, typename Visit>
auto VisitMeasurementKind(int kind, Visit&& visit) {
  using Costs = MeasurementCosts<Pose, Landmark>;
  using Tag = MeasurementTag<std::tuple_element_t<kFirst, Costs>>;
  if constexpr (kFirst + 1 < std::tuple_size_v<Costs>) {
    if (kind != kFirst) return VisitMeasurementKind<Pose, Landmark, kFirst + 1>(kind, visit);
  }
  return visit(Tag{});
}

/// The number of values in one measurement of a kind.
inline int MeasurementSize(int kind) {
  return VisitMeasurementKind<Se2, EllipsoidModel>(
      kind, [](auto tag) { return decltype(tag)::Cost::kResidualSize; });
}

inline const char* MeasurementName(int kind) {
  return VisitMeasurementKind<Se2, EllipsoidModel>(
      kind, [](auto tag) { return decltype(tag)::Cost::kName; });
}

/// The index of the kind with that name, or -1 if there is none.
inline int MeasurementKind(const std::string& name) {
  for (int kind = 0; kind < kNumMeasurementKinds; ++kind) {
    if (name == MeasurementName(kind)) return kind;
  }
  return -1;
}

/// Square root of the information of one measurement, from its covariance.  Both are square
/// matrices, stored row by row.  Throws std::invalid_argument for a covariance that is not positive
/// definite.
inline RowMatrix MeasurementSqrtInformation(int kind, const double* covariance) {
  return VisitMeasurementKind<Se2, EllipsoidModel>(kind, [&](auto tag) -> RowMatrix {
    constexpr int m = decltype(tag)::Cost::kResidualSize;
    using Square = Eigen::Matrix<double, m, m>;
    return SqrtInformation<m>(Square(Eigen::Map<const Square>(covariance)));  // symmetric
  });
}

/// The cost of one measurement of m values.  `sqrt_information` is the m x m square root of their
/// information, stored row by row.
template <typename Cost>
Cost MakeMeasurementCost(const double* value, const double* sqrt_information) {
  constexpr int m = Cost::kResidualSize;
  constexpr int order = m == 1 ? Eigen::ColMajor : Eigen::RowMajor;
  return {{},
          Eigen::Map<const Eigen::Matrix<double, m, 1>>(value),
          Eigen::Map<const Eigen::Matrix<double, m, m, order>>(sqrt_information)};
}

}  // namespace dqslam
