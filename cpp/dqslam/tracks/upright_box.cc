#include "dqslam/tracks/upright_box.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace dqslam::tracks {
namespace {

constexpr int kCorners = 8;
// A corner nearer to the plane of the camera than this share of its distance has no pixel.
constexpr double kNearest = 1e-3;
// A corner so many times further inward than the outermost one has no share in an edge.
constexpr double kNoShare = 40;

struct Corner {
  Eigen::Vector3d side;  // from the foot, along length, width and height, meters
  Eigen::Vector3d arm;   // the same in the upright frame
  Eigen::Vector3d seen;  // in the frame of the camera
  Eigen::Vector2d ray, pixel;
  bool is_ahead;
};

}  // namespace

UprightBox PredictBox(const Camera& camera, const View& view, const UprightCuboid& cuboid) {
  const double cos = std::cos(cuboid.heading), sin = std::sin(cuboid.heading);
  const Eigen::Vector2d focal(camera.fx, camera.fy), middle(camera.cx, camera.cy);
  UprightBox result;
  result.in_front = false;
  result.is_whole = true;
  Corner corners[kCorners];
  for (int i = 0; i < kCorners; ++i) {
    Corner& corner = corners[i];
    corner.side << (i & 4 ? 1 : -1) * cuboid.half[0], (i & 2 ? 1 : -1) * cuboid.half[1],
        (i & 1 ? 2 : 0) * cuboid.half[2];
    corner.arm << cos * corner.side[0] - sin * corner.side[1],
        sin * corner.side[0] + cos * corner.side[1], corner.side[2];
    const Eigen::Vector3d offset = cuboid.foot + corner.arm - view.position;
    corner.seen = view.rotation.transpose() * offset;
    corner.is_ahead = corner.seen.z() > kNearest * offset.norm();
    result.in_front |= corner.is_ahead;
    result.is_whole &= corner.is_ahead;
    corner.ray = corner.seen.head<2>() / (corner.is_ahead ? corner.seen.z() : 1.0);
    corner.pixel = middle + focal.cwiseProduct(corner.ray);
  }
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const int axis = edge % 2;
    const double sign = edge < 2 ? -1 : 1;
    int outermost = 0;
    double most = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < kCorners; ++i) {
      if (!corners[i].is_ahead || sign * corners[i].pixel[axis] <= most) continue;
      most = sign * corners[i].pixel[axis];
      outermost = i;
    }
    result.corner.row(edge) = corners[outermost].pixel;
    double weights[kCorners], total = 0, mean = 0;
    for (int i = 0; i < kCorners; ++i) {
      const double inward = (most - sign * corners[i].pixel[axis]) / kRoundedPx;
      weights[i] = corners[i].is_ahead && inward < kNoShare ? std::exp(-inward) : 0;
      total += weights[i];
      mean += weights[i] * corners[i].pixel[axis];
    }
    mean /= total;
    result.box[edge] = mean;  // NaN where no corner is ahead
    Eigen::Vector3d by_shift = Eigen::Vector3d::Zero(), by_turn = by_shift, by_size = by_shift;
    double by_heading = 0;
    for (int i = 0; i < kCorners; ++i) {
      if (weights[i] == 0) continue;
      const Corner& corner = corners[i];
      // How the edge changes with the pixel of this corner, and a pixel with the corner: f / z
      // along its own axis, -f / z ray along z.
      const double share =
          weights[i] / total * (1 + sign * (corner.pixel[axis] - mean) / kRoundedPx);
      const double scale = share * focal[axis] / corner.seen.z();
      Eigen::Vector3d by_seen = Eigen::Vector3d::Zero();
      by_seen[axis] = scale;
      by_seen[2] = -scale * corner.ray[axis];
      const Eigen::Vector3d by_point = view.rotation * by_seen;
      by_shift += by_seen;
      by_turn += corner.seen.cross(by_seen);
      by_heading += by_point.y() * corner.arm.x() - by_point.x() * corner.arm.y();
      by_size[0] += (by_point.x() * cos + by_point.y() * sin) * corner.side[0];
      by_size[1] += (by_point.y() * cos - by_point.x() * sin) * corner.side[1];
      by_size[2] += by_point.z() * corner.side[2];
    }
    result.by_place.row(edge) << (view.rotation * by_shift).transpose(), by_heading;
    result.by_size.row(edge) = by_size;
    result.by_camera.row(edge) << -by_shift.transpose(), -by_turn.transpose();
  }
  return result;
}

}  // namespace dqslam::tracks
