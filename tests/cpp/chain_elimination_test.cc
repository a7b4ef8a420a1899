#include "dqslam/linear/chain_elimination.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>
#include <vector>

namespace dqslam {
namespace {

// A random chain with objects that come, go and share places in the front, beside the same normal
// equations as one dense matrix.
template <int k>
class ChainTest {
 public:
  static constexpr int kPoses = 12, kObjects = 5;
  static constexpr int kSize = kPoses * k + kObjects * 9;

  explicit ChainTest(double damping) : damping_(damping) {
    // First and last pose that sees each object; the third is seen once.
    const int first[kObjects] = {0, 1, 3, 5, 8}, last[kObjects] = {4, 11, 3, 9, 11};
    chain_.Reset(damping);
    std::vector<int> slots(kObjects, -1);
    for (int pose = 0; pose < kPoses && solved_; ++pose) {
      if (pose == 0) {
        const Square J = Random<k, k>();
        const Column r = Random<k, 1>();
        chain_.AddPose(J.transpose() * J, J.transpose() * r);
        AddDense(J, 0, r);
      } else {
        const Square from = Random<k, k>(), to = Random<k, k>();
        const Column r = Random<k, 1>();
        solved_ = chain_.NextPose(r, from, to);
        Eigen::MatrixXd J = Eigen::MatrixXd::Zero(k, kSize);
        J.middleCols((pose - 1) * k, k) = from;
        J.middleCols(pose * k, k) = to;
        AddRows(J, r);
        for (int object = 0; object < kObjects; ++object) {
          if (last[object] == pose - 1) solved_ = solved_ && chain_.EliminateObject(slots[object]);
        }
      }
      for (int object = 0; object < kObjects; ++object) {
        if (pose < first[object] || pose > last[object]) continue;
        if (pose == first[object]) {
          slots[object] = chain_.AddObject(object);
          const Eigen::Matrix<double, 9, 9> J = Random<9, 9>();
          const Vector9d r = Random<9, 1>();
          chain_.AddObjectInformation(slots[object], J.transpose() * J, J.transpose() * r);
          AddDense(J, kPoses * k + 9 * object, r);
        }
        const Eigen::Matrix<double, 4, k> by_pose = Random<4, k>();
        const Eigen::Matrix<double, 4, 9> by_object = Random<4, 9>();
        const Eigen::Vector4d r = Random<4, 1>();
        chain_.AddObservation(slots[object], r, by_pose, by_object);
        Eigen::MatrixXd J = Eigen::MatrixXd::Zero(4, kSize);
        J.middleCols(pose * k, k) = by_pose;
        J.middleCols(kPoses * k + 9 * object, 9) = by_object;
        AddRows(J, r);
      }
    }
    solved_ = solved_ && chain_.Finish();
  }

  void ExpectDenseSolution() {
    ASSERT_TRUE(solved_);
    Eigen::MatrixXd H = H_;
    H.diagonal() *= 1 + damping_;
    const Eigen::VectorXd expected = -H.llt().solve(g_);
    Eigen::VectorXd found = Eigen::VectorXd::Constant(kSize, 1e9);
    int pose = kPoses, objects = 0;
    chain_.BackSubstitute([&](const Column& step) { found.segment<k>(--pose * k) = step; },
                          [&](int name, const Vector9d& step) {
                            found.segment<9>(kPoses * k + 9 * name) = step;
                            ++objects;
                          });
    EXPECT_EQ(pose, 0);
    EXPECT_EQ(objects, kObjects);
    EXPECT_LT((found - expected).norm(), 1e-9 * expected.norm());
  }

 private:
  using Square = Eigen::Matrix<double, k, k>;
  using Column = Eigen::Matrix<double, k, 1>;

  template <int rows, int columns>
  Eigen::Matrix<double, rows, columns> Random() {
    std::normal_distribution<double> normal;
    return Eigen::Matrix<double, rows, columns>::NullaryExpr([&] { return normal(random_); });
  }

  void AddRows(const Eigen::MatrixXd& J, const Eigen::VectorXd& r) {
    H_ += J.transpose() * J;
    g_ += J.transpose() * r;
  }
  void AddDense(const Eigen::MatrixXd& block, int at, const Eigen::VectorXd& r) {
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(block.rows(), kSize);
    J.middleCols(at, block.cols()) = block;
    AddRows(J, r);
  }

  double damping_;
  bool solved_ = true;
  std::mt19937 random_{7};
  ChainElimination<k> chain_;
  Eigen::MatrixXd H_ = Eigen::MatrixXd::Zero(kSize, kSize);
  Eigen::VectorXd g_ = Eigen::VectorXd::Zero(kSize);
};

TEST(ChainElimination, SolvesTheNormalEquationsOfThePlane) {
  ChainTest<3>(0).ExpectDenseSolution();
}

TEST(ChainElimination, SolvesTheNormalEquationsOfSpace) {
  ChainTest<6>(0).ExpectDenseSolution();
}

TEST(ChainElimination, DampsEveryDiagonalEntry) {
  ChainTest<3>(0.3).ExpectDenseSolution();
}

TEST(ChainElimination, RefusesAPoseThatNothingDetermines) {
  ChainElimination<3> chain;
  chain.Reset(0);
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  EXPECT_FALSE(chain.NextPose(Eigen::Vector3d::Zero(), zero, zero));
}

TEST(ChainElimination, RefusesNaN) {
  ChainElimination<3> chain;
  chain.Reset(0);
  const Eigen::Matrix3d nan = Eigen::Matrix3d::Constant(std::nan(""));
  EXPECT_FALSE(chain.NextPose(Eigen::Vector3d::Zero(), nan, nan));
}

}  // namespace
}  // namespace dqslam
