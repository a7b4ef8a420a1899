#include "dqslam/geometry/box_derivatives.h"

#include <gtest/gtest.h>

#include "situation.h"

namespace dqslam {
namespace {

constexpr int kTrials = 50;

template <typename Types>
class EdgesOf : public testing::Test {};
using AllTypes = testing::Types<std::pair<Se2, EllipsoidModel>, std::pair<Se3, EllipsoidModel>>;
TYPED_TEST_SUITE(EdgesOf, AllTypes);

/// Of unweighted errors, beside AutoDiff's of the cost: relative to its largest entry.
template <typename Pose, typename Landmark>
void ExpectDerivatives(const Situation<Pose, Landmark>& situation,
                       const EdgeDerivatives& edges,
                       const ceres::CostFunction& cost) {
  const Station station = Station::At<Pose>(situation.pose.data(), situation.mount);
  const Unpacked<Landmark> landmark(situation.landmark.data());
  Eigen::Matrix<double, kBoxSize, Pose::kTangentSize> by_pose;
  Eigen::Matrix<double, kBoxSize, kLandmarkSize> by_landmark;
  ByPoseAndLandmark<Pose>(edges, station, situation.mount, landmark, &by_pose, &by_landmark);
  const Eigen::MatrixXd expected_pose = AutoDiffJacobian(cost, situation.Blocks(), 0);
  const Eigen::MatrixXd expected_landmark = AutoDiffJacobian(cost, situation.Blocks(), 1);
  EXPECT_LT((by_pose - expected_pose).cwiseAbs().maxCoeff(),
            1e-9 * expected_pose.cwiseAbs().maxCoeff());
  EXPECT_LT((by_landmark - expected_landmark).cwiseAbs().maxCoeff(),
            1e-9 * expected_landmark.cwiseAbs().maxCoeff());
}

template <typename Pose, typename Landmark>
Surface<double> InCamera(const Situation<Pose, Landmark>& situation) {
  return ToCamera(LocateCamera<Pose>(situation.pose.data(), situation.mount),
                  Landmark::Unpack(situation.landmark.data()));
}

TYPED_TEST(EdgesOf, TheBoxMovesAsAutoDiffSays) {
  Random random(3);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Situation<typename TypeParam::first_type, typename TypeParam::second_type> situation(
        random);
    Eigen::Vector4d box;
    EdgeDerivatives edges;
    ASSERT_TRUE(DifferentiateBox(InCamera(situation), situation.camera, &box, &edges));
    const Eigen::Vector4d expected =
        oracle::Box(situation.camera, situation.view, situation.ellipsoid);
    EXPECT_LT((box - expected).cwiseAbs().maxCoeff(), 1e-3);
    ExpectDerivatives(situation, edges, *situation.Box(Eigen::Matrix4d::Identity()));
  }
}

TYPED_TEST(EdgesOf, TheTangentsMoveAsAutoDiffSays) {
  Random random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Situation<typename TypeParam::first_type, typename TypeParam::second_type> situation(
        random);
    const CostPointer cost = situation.Tangent(Eigen::Matrix4d::Identity(), 4);
    Eigen::Vector4d distances;
    EdgeDerivatives edges;
    ASSERT_TRUE(DifferentiateTangents(
        InCamera(situation), situation.camera, situation.observed, 4, &distances, &edges));
    EXPECT_LT((distances - ResidualOf(*cost, situation.Blocks())).cwiseAbs().maxCoeff(), 1e-9);
    ExpectDerivatives(situation, edges, *cost);
  }
}

TYPED_TEST(EdgesOf, ABehindObjectHasNoBox) {
  Random random(5);
  Situation<typename TypeParam::first_type, typename TypeParam::second_type> situation(random);
  situation.Place({0.3, 0.2, -5}, random);
  Eigen::Vector4d box;
  EdgeDerivatives edges;
  EXPECT_FALSE(DifferentiateBox(InCamera(situation), situation.camera, &box, &edges));
}

}  // namespace
}  // namespace dqslam
