#include "dqslam/estimation/pair_starts.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dqslam/costs/box_chi_square.h"
#include "dqslam/estimation/start_object.h"

namespace dqslam {
namespace {

constexpr int kMostPairs = 500;
constexpr size_t kMostStarts = 3;

// How far the boxes are from an object.  A sphere from two boxes is only roughly the object, so
// that boxes near to it count, too; those that are far away count nearly alike.
double Distance(const SolveContext& context,
                const std::vector<View>& views,
                const Vector9d& start) {
  const Surface<double> surface = EllipsoidModel::Unpack(start.data());
  double sum = 0;
  for (const View& view : views) {
    const double chi_square = BoxChiSquare(ToCamera(view.camera, surface),
                                           context.graph().camera,
                                           view.box,
                                           view.truncated,
                                           view.sqrt_information);
    const double far = chi_square / context.options.outlier_chi_square;
    sum += std::isfinite(far) ? far / (10 + far) : 1;
  }
  return sum;
}

bool IsAtOnePlace(const Vector9d& a, const Vector9d& b) {
  const double radius = std::exp(std::max(a[3], b[3]));
  return (a.head<3>() - b.head<3>()).norm() < radius;
}

}  // namespace

std::vector<Vector9d> StartsFromPairs(const SolveContext& context, const State& state, int object) {
  const std::vector<View> views =
      ViewsOf(context.prepared, state, context.prepared.boxes_of_object[object]);
  const SizePrior prior = SizePriorOf(context.graph(), state, object);
  const size_t count = views.size();
  const size_t stride = std::max<size_t>(1, count * (count - 1) / 2 / kMostPairs);
  std::vector<std::pair<double, Vector9d>> found;
  size_t pair = 0;
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = i + 1; j < count; ++j) {
      if (pair++ % stride != 0) continue;
      const Vector9d start = FitSphere(context.graph().camera, {views[i], views[j]}, prior);
      found.emplace_back(Distance(context, views, start), start);
    }
  }
  std::stable_sort(
      found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Vector9d> starts;
  for (const auto& [distance, start] : found) {
    if (starts.size() == kMostStarts) break;
    const bool is_known = std::any_of(starts.begin(), starts.end(), [&](const Vector9d& known) {
      return IsAtOnePlace(known, start);
    });
    if (!is_known) starts.push_back(start);
  }
  return starts;
}

}  // namespace dqslam
