#include "dqslam/geometry/pose.h"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include "oracle.h"
#include "random.h"

namespace dqslam {
namespace {

constexpr int kTrials = 100;

template <typename Pose>
class PoseModels : public testing::Test {
 protected:
  using Vector = Eigen::Matrix<double, Pose::kSize, 1>;
  using Tangent = Eigen::Matrix<double, Pose::kTangentSize, 1>;

  Vector Random() { return random_.RandomPose<Pose>(); }
  Tangent RandomTangent(double max_angle) { return random_.RandomTangent<Pose>(max_angle); }

  static Vector Identity() {
    Vector pose;
    Pose::FromTangent(Tangent::Zero().eval().data(), pose.data());
    return pose;
  }
  static Vector Compose(const Vector& a, const Vector& b) {
    Vector result;
    Pose::Compose(a.data(), b.data(), result.data());
    return result;
  }
  static Vector Between(const Vector& a, const Vector& b) {
    Vector result;
    Pose::Between(a.data(), b.data(), result.data());
    return result;
  }
  static Vector Plus(const Vector& pose, const Tangent& tangent) {
    Vector result;
    dqslam::Plus<Pose>(pose.data(), tangent.data(), result.data());
    return result;
  }
  static Tangent Minus(const Vector& pose, const Vector& origin) {
    Tangent result;
    dqslam::Minus<Pose>(pose.data(), origin.data(), result.data());
    return result;
  }
  /// 4 x 4 matrix: the same for q and -q, and for angles 2 pi apart.
  static Eigen::Matrix4d Matrix(const Vector& pose) {
    const Rigid<double> rigid = Pose::WorldFromRobot(pose.data());
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() = rigid.rotation;
    matrix.topRightCorner<3, 1>() = rigid.translation;
    return matrix;
  }
  static void ExpectEqual(const Vector& a, const Vector& b) {
    EXPECT_TRUE(Matrix(a).isApprox(Matrix(b), 1e-12)) << a.transpose() << "\n" << b.transpose();
  }

  dqslam::Random random_{1};
};

using Models = testing::Types<Se2, Se3>;
TYPED_TEST_SUITE(PoseModels, Models);

TYPED_TEST(PoseModels, IdentityIsNeutralOnBothSides) {
  const auto identity = this->Identity();
  EXPECT_TRUE(this->Matrix(identity).isIdentity(0));
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto a = this->Random();
    this->ExpectEqual(this->Compose(identity, a), a);
    this->ExpectEqual(this->Compose(a, identity), a);
  }
}

TYPED_TEST(PoseModels, ComposeIsAssociative) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto a = this->Random(), b = this->Random(), c = this->Random();
    this->ExpectEqual(this->Compose(this->Compose(a, b), c), this->Compose(a, this->Compose(b, c)));
  }
}

TYPED_TEST(PoseModels, ComposeIsTheProductOfMatrices) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto a = this->Random(), b = this->Random();
    const Eigen::Matrix4d product = this->Matrix(a) * this->Matrix(b);
    EXPECT_TRUE(this->Matrix(this->Compose(a, b)).isApprox(product, 1e-12));
  }
}

TYPED_TEST(PoseModels, BetweenIsTheInverseOfCompose) {
  const auto identity = this->Identity();
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto a = this->Random(), b = this->Random();
    this->ExpectEqual(this->Between(a, this->Compose(a, b)), b);
    this->ExpectEqual(this->Compose(a, this->Between(a, b)), b);
    this->ExpectEqual(this->Between(a, a), identity);
    const auto inverse = this->Between(a, identity);
    this->ExpectEqual(this->Compose(a, inverse), identity);
    this->ExpectEqual(this->Compose(inverse, a), identity);
  }
}

TYPED_TEST(PoseModels, PlusOfMinusIsThePose) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto pose = this->Random(), origin = this->Random();
    this->ExpectEqual(this->Plus(origin, this->Minus(pose, origin)), pose);
  }
}

TYPED_TEST(PoseModels, MinusOfPlusIsTheTangent) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto origin = this->Random();
    for (const double max_angle : {M_PI - 1e-9, 1e-3, 1e-8, 1e-12}) {
      const auto tangent = this->RandomTangent(max_angle);
      const auto found = this->Minus(this->Plus(origin, tangent), origin);
      EXPECT_LT((found - tangent).norm(), 1e-11) << max_angle;
    }
  }
}

TYPED_TEST(PoseModels, MinusIsZeroOnlyForTheSamePose) {
  const auto pose = this->Random();
  EXPECT_LT(this->Minus(pose, pose).norm(), 1e-15);
  for (int axis = 0; axis < TypeParam::kTangentSize; ++axis) {
    const auto tangent = (1e-6 * TestFixture::Tangent::Unit(axis)).eval();
    EXPECT_NEAR(this->Minus(this->Plus(pose, tangent), pose).norm(), 1e-6, 1e-14);
  }
}

TEST(Se2, ComposeByHand) {
  const double a[3] = {1, 2, M_PI / 2}, b[3] = {3, 4, M_PI / 6};
  double c[3];
  Se2::Compose(a, b, c);  // turned by 90 degrees, (3, 4) becomes (-4, 3)
  EXPECT_DOUBLE_EQ(c[0], -3);
  EXPECT_DOUBLE_EQ(c[1], 5);
  EXPECT_DOUBLE_EQ(c[2], M_PI * 2 / 3);
}

TEST(Se2, MinusWrapsTheAngle) {
  const auto angle_between = [](double angle, double origin) {
    const double a[3] = {0, 0, angle}, b[3] = {0, 0, origin};
    double tangent[3];
    Minus<Se2>(a, b, tangent);
    return tangent[2];
  };
  EXPECT_NEAR(angle_between(3, -3), 6 - 2 * M_PI, 1e-15);
  EXPECT_NEAR(angle_between(-3, 3), 2 * M_PI - 6, 1e-15);
  EXPECT_NEAR(angle_between(0.25 + 10 * M_PI, 0), 0.25, 1e-13);
  EXPECT_NEAR(angle_between(0.25 - 10 * M_PI, 0), 0.25, 1e-13);
  EXPECT_NEAR(std::abs(angle_between(M_PI, 0)), M_PI, 1e-15);
  EXPECT_NEAR(std::abs(angle_between(-M_PI, 0)), M_PI, 1e-15);
  EXPECT_EQ(angle_between(0.1, 0.1), 0);
}

TEST(ExpRotation, QuarterTurnByHand) {
  const Eigen::Quaterniond q = ExpRotation<double>({0, 0, M_PI / 2});
  EXPECT_LT((q.coeffs() - Eigen::Vector4d(0, 0, std::sqrt(0.5), std::sqrt(0.5))).norm(), 1e-15);
}

TEST(ExpRotation, TurnsAroundTheAxisByTheNorm) {
  Random random(2);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Vector3<double> axis = random.UnitQuaternion().head<3>().normalized();
    const double angle = random.Uniform(0, 4);
    const Eigen::Matrix3d expected = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    const Eigen::Quaterniond q = ExpRotation<double>(angle * axis);
    EXPECT_TRUE(oracle::RotationMatrix(q.coeffs()).isApprox(expected, 1e-14));
  }
}

TEST(LogRotation, InvertsExpAtAllAngles) {
  Random random(3);
  for (const double angle : {0.0,
                             1e-300,
                             1e-12,
                             0.9e-8,
                             1.1e-8,
                             1e-7,
                             1e-4,
                             1.0,
                             M_PI - 1e-4,
                             M_PI - 1e-8,
                             M_PI - 1e-12}) {
    for (int trial = 0; trial < 10; ++trial) {
      const Vector3<double> v = angle * random.UnitQuaternion().head<3>().normalized();
      EXPECT_LE((LogRotation(ExpRotation(v)) - v).norm(), 1e-15 + 4e-15 * angle) << angle;
    }
  }
}

// a_from_b o Exp(x) = Exp(A x) o a_from_b, to first order.
TYPED_TEST(PoseModels, AdjointCarriesSmallMotionsOver) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto pose = this->Random();
    const auto tangent = (1e-6 * this->RandomTangent(1)).eval();
    const auto moved = (Adjoint<TypeParam>(pose.data()) * tangent).eval();
    const auto after = this->Plus(pose, tangent);
    const auto before = this->Compose(this->Plus(this->Identity(), moved), pose);
    EXPECT_LT(this->Minus(after, before).norm(), 1e-10);
  }
}

TYPED_TEST(PoseModels, AdjointOfAProductIsTheProduct) {
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto a = this->Random(), b = this->Random();
    const auto product = this->Compose(a, b);
    EXPECT_LT((Adjoint<TypeParam>(product.data()) -
               Adjoint<TypeParam>(a.data()) * Adjoint<TypeParam>(b.data()))
                  .norm(),
              1e-12);
  }
}

// A turn in the frame of b, 2 m ahead and looking left, moves a sideways.
TEST(Adjoint, InThePlaneByHand) {
  const double a_from_b[] = {2, 0, M_PI / 2};
  Eigen::Matrix3d expected;
  expected << 0, -1, 0, 1, 0, -2, 0, 0, 1;
  EXPECT_LT((Adjoint<Se2>(a_from_b) - expected).norm(), 1e-15);
}

TEST(LogRotation, HalfATurnHasNormPi) {
  const Vector3<double> log = LogRotation(Eigen::Quaterniond(0, 0.6, 0, 0.8));
  EXPECT_LT((log - M_PI * Vector3<double>(0.6, 0, 0.8)).norm(), 1e-15);
}

TEST(LogRotation, IsTheSameForBothSignsOfTheQuaternion) {
  Random random(4);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Eigen::Vector4d q = random.UnitQuaternion();
    const Vector3<double> plus = LogRotation(Eigen::Quaterniond(q.data()));
    const Vector3<double> minus = LogRotation(Eigen::Quaterniond(Eigen::Vector4d(-q).data()));
    EXPECT_EQ(plus, minus);
    EXPECT_LE(plus.norm(), M_PI + 1e-15);
  }
}

using Jet3 = ceres::Jet<double, 3>;

Vector3<Jet3> Variables(const Vector3<double>& values) {
  Vector3<Jet3> jets;
  for (int i = 0; i < 3; ++i) jets[i] = Jet3(values[i], i);
  return jets;
}

TEST(ExpRotation, DerivativeAtZeroIsHalfTheIdentity) {
  const Eigen::Quaternion<Jet3> q = ExpRotation(Variables(Vector3<double>::Zero()));
  EXPECT_TRUE(q.w().v.isZero(0));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(q.vec()[i].v, (0.5 * Eigen::Vector3d::Unit(i)).eval());
}

// Also where the square roots of both functions have no derivative: exactly at zero.
TEST(LogRotation, DerivativeOfLogOfExpIsTheIdentity) {
  Random random(5);
  for (const double angle : {0.0, 1e-12, 0.99e-8, 1.01e-8, 2.1e-8, 1e-5, 1.0, M_PI - 1e-6}) {
    const Vector3<double> v = angle * random.UnitQuaternion().head<3>().normalized();
    const Vector3<Jet3> log = LogRotation(ExpRotation(Variables(v)));
    for (int i = 0; i < 3; ++i) {
      EXPECT_LT((log[i].v - Eigen::Vector3d::Unit(i)).norm(), 1e-7) << "angle " << angle;
    }
  }
}

}  // namespace
}  // namespace dqslam
