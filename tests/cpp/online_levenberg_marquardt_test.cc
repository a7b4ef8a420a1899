#include <gtest/gtest.h>

#include <cmath>

#include "dqslam/online/levenberg_marquardt.h"

namespace dqslam::online {
namespace {

// Rosenbrock's valley as two residuals, 10 (y - x^2) and 1 - x: zero at (1, 1).
struct Valley {
  double most_x = 10;  // states beyond are impossible
  int linearizations = 0;

  static Eigen::Vector2d Residual(const Eigen::Vector2d& at) {
    return {10 * (at.y() - at.x() * at.x()), 1 - at.x()};
  }
  double Linearize(const Eigen::Vector2d& at, Eigen::Matrix2d* H, Eigen::Vector2d* g) {
    ++linearizations;
    Eigen::Matrix2d J;
    J << -20 * at.x(), 10, -1, 0;
    *H = J.transpose() * J;
    *g = J.transpose() * Residual(at);
    return CostAt(at);
  }
  bool Retract(const Eigen::Vector2d& at, const Eigen::Vector2d& step, Eigen::Vector2d* to) const {
    *to = at + step;
    return to->x() <= most_x;
  }
  double CostAt(const Eigen::Vector2d& at) const { return 0.5 * Residual(at).squaredNorm(); }
};

double Minimize(int iterations, double tolerance, Valley* valley, Eigen::Vector2d* at) {
  using Eigen::Matrix2d, Eigen::Vector2d;
  return LevenbergMarquardt<2>(
      iterations,
      tolerance,
      at,
      [=](const Vector2d& at, Matrix2d* H, Vector2d* g) { return valley->Linearize(at, H, g); },
      [=](const Vector2d& at, const Vector2d& step, Vector2d* to) {
        return valley->Retract(at, step, to);
      },
      [=](const Vector2d& at) { return valley->CostAt(at); });
}

TEST(LevenbergMarquardt, FollowsABentValley) {
  Valley valley;
  Eigen::Vector2d at(-1.2, 1);
  const double cost = Minimize(100, 1e-12, &valley, &at);
  EXPECT_LT((at - Eigen::Vector2d(1, 1)).norm(), 1e-9);
  EXPECT_EQ(cost, valley.CostAt(at));
}

TEST(LevenbergMarquardt, StopsAfterAStepThatGainsLittle) {
  Valley valley;
  Eigen::Vector2d at(-1.2, 1);
  const double before = valley.CostAt(at), after = Minimize(100, 1.0, &valley, &at);
  EXPECT_EQ(valley.linearizations, 1);
  EXPECT_LT(after, before);
}

TEST(LevenbergMarquardt, NeverTakesAStepThatCostsMoreOrIsImpossible) {
  Valley valley;
  valley.most_x = -1.2;
  Eigen::Vector2d at(-1.2, 1.44);  // on the valley's floor: every step that gains leads ahead
  EXPECT_EQ(Minimize(30, 1e-12, &valley, &at), 0.5 * 2.2 * 2.2);
  EXPECT_EQ(at, Eigen::Vector2d(-1.2, 1.44));
  EXPECT_EQ(valley.linearizations, 1) << "it has not moved";
}

}  // namespace
}  // namespace dqslam::online
