#include "dqslam/estimation/rigid_consensus.h"

#include <gtest/gtest.h>

#include "random.h"

namespace dqslam {
namespace {

template <typename Pose>
class RigidConsensus : public testing::Test {
 protected:
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;

  static Storage Motion() {
    Storage motion = Storage::Zero();
    motion.template head<2>() << 3, -2;
    if constexpr (Pose::kModel == PoseModel::kSe2) {
      motion[2] = 2.5;
    } else {
      const Eigen::AngleAxisd turn(2.5, Eigen::Vector3d(1, 2, 3).normalized());
      motion.tail(4) = Eigen::Quaterniond(turn).coeffs();
    }
    return motion;
  }

  static std::vector<PlacePair> Pairs(int count) {
    const Rigid<double> rigid = Pose::template WorldFromRobot<double>(Motion().eval().data());
    Random random(3);
    std::vector<PlacePair> pairs;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d seen = random.template UniformVector<3>(-4, 4);
      pairs.push_back({seen, rigid.rotation * seen + rigid.translation, 0.2});
    }
    return pairs;
  }
};

using PoseTypes = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(RigidConsensus, PoseTypes);

TYPED_TEST(RigidConsensus, FindsTheMotionOfMostPairs) {
  std::vector<PlacePair> pairs = this->Pairs(8);
  for (const size_t wrong : {1, 4, 6}) pairs[wrong].known += Eigen::Vector3d(2, 3, 1);
  pairs[4].known.x() -= 7;
  std::vector<size_t> agreed;
  const auto motion = FindRigidMotion<TypeParam>(pairs, &agreed);
  ASSERT_TRUE(motion);
  EXPECT_EQ(agreed, (std::vector<size_t>{0, 2, 3, 5, 7}));
  const double sign = motion->coeff(motion->size() - 1) * this->Motion()[motion->size() - 1];
  auto found = *motion;
  if (TypeParam::kModel == PoseModel::kSe3 && sign < 0) found.tail(4) *= -1;
  EXPECT_LT((found - this->Motion()).norm(), 1e-12);
}

TYPED_TEST(RigidConsensus, NeedsMoreThanOnePair) {
  std::vector<size_t> agreed;
  EXPECT_FALSE(FindRigidMotion<TypeParam>({}, &agreed));
  EXPECT_FALSE(FindRigidMotion<TypeParam>(this->Pairs(1), &agreed));
  EXPECT_TRUE(agreed.empty());
}

// A rigid motion keeps distances: here each is twice as long.
TYPED_TEST(RigidConsensus, FindsNothingWherePairsContradictEachOther) {
  std::vector<PlacePair> pairs = this->Pairs(6);
  for (PlacePair& pair : pairs) pair.known *= 2;
  std::vector<size_t> agreed;
  EXPECT_FALSE(FindRigidMotion<TypeParam>(pairs, &agreed));
}

// The sphere that fits the exact boxes of a sphere is that sphere; the tolerance is its radius and
// a tenth of the mean distance.
TEST(PlaceOf, IsTheCenterOfASphere) {
  Camera camera;
  camera.fx = camera.fy = 400;
  camera.cx = 320;
  camera.cy = 240;
  const Eigen::Vector3d center(0.5, 0.2, 5);
  const Surface<double> sphere{center, 0.25 * Eigen::Matrix3d::Identity()};
  std::vector<View> views;
  for (const double x : {-1.0, 1.0}) {
    View view;
    view.camera = {Eigen::Matrix3d::Identity(), Eigen::Vector3d(x, 0, 0)};
    view.sqrt_information.setIdentity();
    ASSERT_TRUE(ProjectToBox(ToCamera(view.camera, sphere), camera, &view.box));
    views.push_back(view);
  }
  const PlacePair place = PlaceOf(camera, views, sphere);
  EXPECT_LT((place.seen - center).norm(), 1e-9);
  EXPECT_EQ(place.known, center);
  const double distance = (std::sqrt(1.5 * 1.5 + 0.04 + 25) + std::sqrt(0.25 + 0.04 + 25)) / 2;
  EXPECT_NEAR(place.tolerance, 0.5 + 0.1 * distance, 1e-9);
}

}  // namespace
}  // namespace dqslam
