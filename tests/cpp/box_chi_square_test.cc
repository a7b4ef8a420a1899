#include "dqslam/costs/box_chi_square.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "cameras.h"
#include "dqslam/costs/whitening.h"

namespace dqslam {
namespace {

constexpr double kRadius = 0.5;

// Box i at the origin; what is not given is diagonal noise of 1 px.
struct Boxes {
  explicit Boxes(int count)
      : poses(RowMatrix::Zero(count, Se3::kSize)),
        ellipsoids(count, kLandmarkSize),
        boxes(count, kBoxSize),
        covariances(count, 16),
        truncated(BoolTable::Constant(count, kBoxSize, false)) {
    poses.col(6).setOnes();
    covariances.rowwise() = Eigen::Matrix4d::Identity().reshaped<Eigen::RowMajor>().transpose();
  }
  Eigen::VectorXd ChiSquares() const {
    return BoxChiSquareRows(
        PoseModel::kSe3, MakeCamera(), poses, ellipsoids, boxes, covariances, truncated);
  }
  RowMatrix poses, ellipsoids, boxes, covariances;
  BoolTable truncated;
};

// A sphere of radius 3 at a distance of 5: its box is 3 / 4 of the focal lengths around the middle.
TEST(BoxChiSquare, ByHand) {
  Boxes one(1);
  one.ellipsoids.row(0) = Sphere({0, 0, 5}, 3);
  one.boxes.row(0) << 320 - 375 + 2, 240 - 300 - 1, 320 + 375 + 3, 240 + 300 + 3;
  // Errors -2, 1, -3, -3; of the first two, with [4 1; 1 1]^-1 = [1 -1; -1 4] / 3, 12 / 3.
  one.covariances.row(0) << 4, 1, 0, 0, 1, 1, 0, 0, 0, 0, 9, 0, 0, 0, 0, 9;
  EXPECT_NEAR(one.ChiSquares()[0], 4 + 1 + 1, 1e-12);
}

TEST(BoxChiSquare, OfACutEdgeCountsWhereTheObjectEndsInside) {
  Boxes two(2);
  for (const int row : {0, 1}) {
    two.ellipsoids.row(row) = Sphere({0, 0, 10}, 1);
    two.truncated.row(row) << false, false, true, false;
    const double half = 1 / std::sqrt(99.0);
    const double outwards = row == 0 ? 4 : -4;  // of the cut edge, from where the object ends
    two.boxes.row(row) << 320 - 500 * half, 240 - 400 * half, 320 + 500 * half + outwards,
        240 + 400 * half;
  }
  const Eigen::VectorXd chi_squares = two.ChiSquares();
  EXPECT_NEAR(chi_squares[0], 16, 1e-9);
  EXPECT_NEAR(chi_squares[1], 0, 1e-9);
}

// The outline of a sphere of radius r around p: |p x ray|^2 = r^2 |ray|^2.
double HalfHeightAt(double x, const Eigen::Vector3d& p) {
  const double along = x * p.x() + p.z();
  return std::sqrt(along * along / (p.squaredNorm() - kRadius * kRadius) - x * x - 1);
}

// At 3 m all but the right edge is seen as it is.  Further out the object is highest beyond the
// border, and top and bottom of the box are where the border cuts the outline.
TEST(BoxChiSquare, OfAPerfectEstimateIsZeroWhereTheBorderCutsTheBox) {
  const double border = 639.5;
  const double x = (border - 320) / 500;
  const double centers[] = {3.0, 3.2, 3.4, 3.6};
  Boxes boxes(4);
  for (int row = 0; row < 4; ++row) {
    const Eigen::Vector3d p(centers[row], 0, 5);
    boxes.ellipsoids.row(row) = Sphere(p, kRadius);
    const double azimuth = std::atan2(p.x(), p.z());
    const double half_angle = std::asin(kRadius / p.norm());
    const double highest = kRadius / std::sqrt(p.z() * p.z() - kRadius * kRadius);
    const double half_height = row == 0 ? highest : HalfHeightAt(x, p);
    boxes.boxes.row(row) << 320 + 500 * std::tan(azimuth - half_angle), 240 - 400 * half_height,
        border, 240 + 400 * half_height;
    EXPECT_LE(half_height, highest);
    boxes.truncated.row(row) << false, false, true, false;
  }
  EXPECT_LT(boxes.ChiSquares().maxCoeff(), 1e-18);
  // Nor is it just that edges are ignored: an object that is too small does not fit.
  boxes.ellipsoids.middleCols<3>(3).array() -= 0.5;
  EXPECT_GT(boxes.ChiSquares().minCoeff(), 100);
  // And a box that no border cut must fit at all edges.
  boxes.ellipsoids.middleCols<3>(3).array() += 0.5;
  boxes.truncated.setConstant(false);
  EXPECT_GT(boxes.ChiSquares().minCoeff(), 100);
}

TEST(BoxChiSquare, IsInfiniteUnlessStrictlyInFront) {
  Boxes three(3);
  three.ellipsoids.row(0) = Sphere({0, 0, -5}, 1);
  three.ellipsoids.row(1) = Sphere({0, 0, 0.5}, 1);
  three.ellipsoids.row(2).setConstant(std::nan(""));
  three.boxes.rowwise() = Eigen::RowVector4d(300, 200, 340, 280);
  EXPECT_TRUE((three.ChiSquares().array() == INFINITY).all());
}

TEST(BoxChiSquareRows, NameTheTableAndTheRow) {
  Boxes boxes(3);
  boxes.ellipsoids.rowwise() = Sphere({0, 0, 5}, 1).transpose();
  boxes.boxes.rowwise() = Eigen::RowVector4d(300, 200, 340, 280);
  const auto message = [&] {
    try {
      boxes.ChiSquares();
      return std::string("no exception");
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
  };
  boxes.covariances(1, 0) = -1;
  EXPECT_EQ(message(), "covariances row 1: covariance is not symmetric positive definite");
  boxes.covariances.conservativeResize(2, 16);
  EXPECT_EQ(message(), "covariances has shape (2, 16), expected (3, 16)");
  boxes.truncated.conservativeResize(3, 3);
  boxes.covariances.conservativeResize(3, 16);
  EXPECT_EQ(message(), "truncated has shape (3, 3), expected (3, 4)");
}

}  // namespace
}  // namespace dqslam
