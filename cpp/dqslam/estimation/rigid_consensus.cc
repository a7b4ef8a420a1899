#include "dqslam/estimation/rigid_consensus.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace dqslam {
namespace {

// The place of an object of known size is the center of a sphere of about this size.
constexpr double kSizeSpread = 0.1;
// How far off the center of an object may be, as a share of its distance.
constexpr double kTolerance = 0.1;

template <typename Pose>
using Motion = Eigen::Matrix<double, Pose::kSize, 1>;

template <typename Pose>
constexpr int kDimension = Pose::kModel == PoseModel::kSe2 ? 2 : 3;

// The motion with the smallest sum of squared distances. (Umeyama 1991)
template <typename Pose>
Motion<Pose> Fit(const std::vector<PlacePair>& pairs, const std::vector<size_t>& rows) {
  Eigen::Matrix<double, 3, Eigen::Dynamic> seen(3, rows.size()), known(3, rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    seen.col(i) = pairs[rows[i]].seen;
    known.col(i) = pairs[rows[i]].known;
  }
  Motion<Pose> result;
  if constexpr (Pose::kModel == PoseModel::kSe3) {
    const Eigen::Matrix4d motion = Eigen::umeyama(seen, known, false);
    const Eigen::Matrix3d rotation = motion.topLeftCorner<3, 3>();
    result << motion.topRightCorner<3, 1>(), Eigen::Quaterniond(rotation).coeffs();
  } else {
    const Eigen::Vector3d from = seen.rowwise().mean(), to = known.rowwise().mean();
    const Eigen::Matrix3d sum = (seen.colwise() - from) * (known.colwise() - to).transpose();
    const double angle = std::atan2(sum(0, 1) - sum(1, 0), sum(0, 0) + sum(1, 1));
    result << to.head<2>() - Eigen::Rotation2Dd(angle) * from.head<2>(), angle;
  }
  return result;
}

// In tolerances.
template <typename Pose>
double ErrorAfter(const Motion<Pose>& motion, const PlacePair& pair) {
  const Rigid<double> rigid = Pose::template WorldFromRobot<double>(motion.data());
  const Eigen::Vector3d error = rigid.rotation * pair.seen + rigid.translation - pair.known;
  return error.head<kDimension<Pose>>().norm() / pair.tolerance;
}

}  // namespace

PlacePair PlaceOf(const Camera& camera,
                  const std::vector<View>& views,
                  const Surface<double>& known) {
  const double radius = std::pow(known.shape.determinant(), 1.0 / 6);
  PlacePair place{{}, known.center, radius};
  place.seen = FitSphere(camera, views, {std::log(radius), kSizeSpread}).head<3>();
  for (const View& view : views) {
    const double distance = (view.camera.position - place.seen).norm();
    place.tolerance += kTolerance * distance / static_cast<double>(views.size());
  }
  return place;
}

template <typename Pose>
std::optional<Motion<Pose>> FindRigidMotion(const std::vector<PlacePair>& pairs,
                                            std::vector<size_t>* agreed) {
  agreed->clear();
  double best = static_cast<double>(pairs.size());
  const auto judge = [&](const std::vector<size_t>& minimal) {
    const Motion<Pose> motion = Fit<Pose>(pairs, minimal);
    double loss = 0;
    std::vector<size_t> close;
    for (size_t row = 0; row < pairs.size(); ++row) {
      const double error = ErrorAfter<Pose>(motion, pairs[row]);
      loss += std::min(error * error, 1.0);
      if (error < 1) close.push_back(row);
    }
    if (close.size() < minimal.size() || loss >= best) return;
    best = loss;
    *agreed = close;
  };
  for (size_t a = 0; a < pairs.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      if constexpr (kDimension<Pose> == 2) {
        judge({a, b});
      } else {
        for (size_t c = 0; c < b; ++c) judge({a, b, c});
      }
    }
  }
  if (agreed->empty()) return std::nullopt;
  return Fit<Pose>(pairs, *agreed);
}

template std::optional<Motion<Se2>> FindRigidMotion<Se2>(const std::vector<PlacePair>&,
                                                         std::vector<size_t>*);
template std::optional<Motion<Se3>> FindRigidMotion<Se3>(const std::vector<PlacePair>&,
                                                         std::vector<size_t>*);

}  // namespace dqslam
