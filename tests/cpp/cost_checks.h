// Checks that hold for every cost: its Jacobians and its whitening.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <memory>
#include <vector>

#include "dqslam/geometry/manifolds.h"

namespace dqslam {

using CostPointer = std::unique_ptr<ceres::CostFunction>;

/// A parameter block: where it stands and how it moves.
struct Block {
  Eigen::VectorXd value;
  std::shared_ptr<ceres::Manifold> manifold;
};

template <typename Pose>
Block PoseBlock(const Eigen::Matrix<double, Pose::kSize, 1>& pose) {
  return {pose, std::make_shared<PoseManifold<Pose>>()};
}

inline Block LandmarkBlock(const Vector9d& landmark) {
  return {landmark, std::make_shared<ceres::EuclideanManifold<kLandmarkSize>>()};
}

inline std::vector<const double*> Pointers(const std::vector<Block>& blocks) {
  std::vector<const double*> pointers;
  for (const Block& block : blocks) pointers.push_back(block.value.data());
  return pointers;
}

/// False where the cost says that its geometry is impossible.
inline bool IsDefined(const ceres::CostFunction& cost, const std::vector<Block>& blocks) {
  Eigen::VectorXd residual(cost.num_residuals());
  return cost.Evaluate(Pointers(blocks).data(), residual.data(), nullptr);
}

inline Eigen::VectorXd ResidualOf(const ceres::CostFunction& cost,
                                  const std::vector<Block>& blocks) {
  Eigen::VectorXd residual(cost.num_residuals());
  EXPECT_TRUE(cost.Evaluate(Pointers(blocks).data(), residual.data(), nullptr));
  return residual;
}

/// AutoDiff Jacobian of block k in its tangent space.
inline Eigen::MatrixXd AutoDiffJacobian(const ceres::CostFunction& cost,
                                        const std::vector<Block>& blocks,
                                        size_t k) {
  const ceres::Manifold& manifold = *blocks[k].manifold;
  RowMatrix ambient(cost.num_residuals(), manifold.AmbientSize());
  RowMatrix plus_jacobian(manifold.AmbientSize(), manifold.TangentSize());
  std::vector<double*> jacobians(blocks.size(), nullptr);
  jacobians[k] = ambient.data();
  Eigen::VectorXd residual(cost.num_residuals());
  EXPECT_TRUE(cost.Evaluate(Pointers(blocks).data(), residual.data(), jacobians.data()));
  EXPECT_TRUE(manifold.PlusJacobian(blocks[k].value.data(), plus_jacobian.data()));
  return ambient * plus_jacobian;
}

/// The same by central differences of fourth order, moving along the manifold.
inline Eigen::MatrixXd PerturbationJacobian(const ceres::CostFunction& cost,
                                            const std::vector<Block>& blocks,
                                            size_t k) {
  constexpr double kStep = 2e-4;
  const ceres::Manifold& manifold = *blocks[k].manifold;
  Eigen::MatrixXd jacobian(cost.num_residuals(), manifold.TangentSize());
  for (int axis = 0; axis < manifold.TangentSize(); ++axis) {
    const auto residual_after = [&](double step) {
      const Eigen::VectorXd tangent = step * Eigen::VectorXd::Unit(manifold.TangentSize(), axis);
      std::vector<Block> moved = blocks;
      EXPECT_TRUE(manifold.Plus(blocks[k].value.data(), tangent.data(), moved[k].value.data()));
      return ResidualOf(cost, moved);
    };
    jacobian.col(axis) = (8 * (residual_after(kStep) - residual_after(-kStep)) -
                          (residual_after(2 * kStep) - residual_after(-2 * kStep))) /
                         (12 * kStep);
  }
  return jacobian;
}

inline void ExpectJacobiansMatchPerturbation(const ceres::CostFunction& cost,
                                             const std::vector<Block>& blocks) {
  for (size_t k = 0; k < blocks.size(); ++k) {
    const Eigen::MatrixXd expected = PerturbationJacobian(cost, blocks, k);
    const Eigen::MatrixXd actual = AutoDiffJacobian(cost, blocks, k);
    EXPECT_LT((actual - expected).cwiseAbs().maxCoeff(), 1e-7 * expected.cwiseAbs().maxCoeff())
        << "block " << k << "\nAutoDiff\n"
        << actual << "\nperturbation\n"
        << expected;
  }
}

/// `whitened` is the cost `plain` (whitened with the identity) under a full covariance.
inline void ExpectWhitened(const ceres::CostFunction& whitened,
                           const ceres::CostFunction& plain,
                           const Eigen::MatrixXd& covariance,
                           const std::vector<Block>& blocks) {
  const Eigen::VectorXd error = ResidualOf(plain, blocks);
  const double mahalanobis_squared = error.dot(covariance.inverse() * error);
  EXPECT_NEAR(
      ResidualOf(whitened, blocks).squaredNorm(), mahalanobis_squared, 1e-9 * mahalanobis_squared);
  EXPECT_GT(std::abs(mahalanobis_squared - error.squaredNorm()), 1e-3 * error.squaredNorm());
}

}  // namespace dqslam
