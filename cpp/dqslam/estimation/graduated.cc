#include "dqslam/estimation/graduated.h"

#include <algorithm>
#include <cmath>

#include "dqslam/estimation/repair.h"

namespace dqslam {
namespace {

constexpr double kGraduation = 1.6;  // the factor of the control parameter in each round
constexpr double kFar = 10;          // chi-square, in units of the threshold
constexpr int kMaxRounds = 60;
constexpr int kRoundIterations = 15;
constexpr double kFewMisfits = 0.01;  // the largest share of the boxes where nearly all fit

// Weight of a box with chi-square s at threshold c2, for control parameter mu (Yang 2020, eqs. 12
// and 14).  For Geman-McClure mu decreases to 1, for truncated least squares it increases.
double Weight(Loss loss, double s, double c2, double mu) {
  if (std::isinf(s)) return 0;
  if (loss == Loss::kGncGm) return std::pow(mu * c2 / (s + mu * c2), 2);
  if (s <= mu / (mu + 1) * c2) return 1;
  if (s >= (mu + 1) / mu * c2) return 0;
  return std::sqrt(c2 * mu * (mu + 1) / s) - mu;
}

}  // namespace

bool IsRobust(Loss loss) {
  return loss != Loss::kNone;
}

bool ThrowsBoxesOut(Loss loss) {
  return IsRobust(loss) && loss != Loss::kHuber && loss != Loss::kCauchy;
}

Summary GraduateNonConvexity(const SolveContext& context, State* state) {
  const bool truncated = context.options.loss == Loss::kGncTls;
  const double c2 = context.options.outlier_chi_square;
  Stage stage = BatchStage(context);
  stage.loss = Loss::kNone;
  stage.minimizer = Minimizer::kLevenbergMarquardt;
  stage.max_iterations = kRoundIterations;
  stage.function_tolerance = context.options.grow_tolerance;
  stage.weights.assign(stage.boxes.size(), 1.0);

  // Yang et al. start with a surrogate that is convex over all residuals, which leads to a fit of
  // all boxes.  A state that was grown with a robust loss is better than that fit.  The first round
  // therefore already leaves out the boxes that are far from it.
  const double largest = kFar * c2;
  double mu = truncated ? c2 / (2 * largest - c2) : 2 * largest / c2;
  Summary total;
  for (int round = 0; round < kMaxRounds; ++round) {
    const Eigen::VectorXd costs = BoxCosts(context, *state);
    bool decided = true;
    for (size_t i = 0; i < stage.boxes.size(); ++i) {
      const double weight = Weight(context.options.loss, 2 * costs[stage.boxes[i]], c2, mu);
      decided = decided && (weight == 0 || weight == 1);
      stage.weights[i] = weight;
    }
    // Where every box fits from the start, there is nothing to graduate.
    if (round == 0 && costs.size() > 0 && 2 * costs.maxCoeff() <= c2) break;
    Append(Optimize(context, stage, state), &total);
    if (truncated ? decided && round > 0 : mu <= 1) break;
    mu = truncated ? mu * kGraduation : std::max(mu / kGraduation, 1.0);
  }
  return total;
}

bool NearlyAllFit(const SolveContext& context, const State& state) {
  const Eigen::ArrayXd chi_squares = 2 * BoxCosts(context, state);
  const Mask misfits = !(chi_squares <= context.options.outlier_chi_square);
  if (misfits.count() > kFewMisfits * misfits.size()) return false;
  if ((!(chi_squares <= kFar * context.options.outlier_chi_square)).any()) return false;
  const auto& objects = context.prepared.boxes_of_object;
  return std::none_of(objects.begin(), objects.end(), [&](const std::vector<int>& rows) {
    const auto count =
        std::count_if(rows.begin(), rows.end(), [&](int row) { return misfits[row]; });
    return IsMixed(count, static_cast<std::ptrdiff_t>(rows.size()));
  });
}

Stage InlierStage(const SolveContext& context, const State& state) {
  Stage stage = BatchStage(context);
  stage.loss = Loss::kNone;
  for (const bool is_inlier : InlierBoxes(context, state)) stage.weights.push_back(is_inlier);
  return stage;
}

std::vector<bool> InlierBoxes(const SolveContext& context, const State& state) {
  const Eigen::VectorXd costs = BoxCosts(context, state);
  std::vector<bool> inliers;
  for (const double cost : costs) inliers.push_back(2 * cost <= context.options.outlier_chi_square);
  return inliers;
}

}  // namespace dqslam
