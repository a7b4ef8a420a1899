// What was estimated elsewhere, taken over by a history that has gone on meanwhile.
#include <stdexcept>

#include "dqslam/online/history.h"

namespace dqslam::online {

template <typename Pose>
void History<Pose>::Merge(const RowMatrix& estimated_poses, const RowMatrix& ellipsoids) {
  const Eigen::Index merged = estimated_poses.rows();
  if (merged < 1 || merged > num_poses() || ellipsoids.rows() > num_objects() ||
      estimated_poses.cols() != Pose::kSize ||
      (ellipsoids.rows() > 0 && ellipsoids.cols() != kLandmarkSize) ||
      !estimated_poses.allFinite() || !ellipsoids.allFinite()) {
    throw std::invalid_argument("merge: expected finite poses and objects of this session");
  }
  const Storage old = poses[merged - 1];
  for (int row = 0; row < merged; ++row) poses[row] = estimated_poses.row(row).transpose();
  const Storage now = poses[merged - 1];
  for (int row = merged; row < num_poses(); ++row) {
    Storage relative;
    Pose::Between(old.data(), poses[row].data(), relative.data());
    poses[row] = Compose(now, relative);
  }
  const Rigid<double> before = Pose::WorldFromRobot(old.data());
  const Rigid<double> after = Pose::WorldFromRobot(now.data());
  const Eigen::Matrix3d turn = after.rotation * before.rotation.transpose();
  for (int row = 0; row < num_objects(); ++row) {
    objects[row].is_stale = true;
    Vector9d& center_shape = objects[row].center_shape;
    if (row < ellipsoids.rows()) {
      center_shape = CenterShapeFromEllipsoid(ellipsoids.row(row).transpose());
      continue;
    }
    Surface<double> surface = SurfaceOf(center_shape);
    surface.center = turn * (surface.center - before.translation) + after.translation;
    surface.shape = turn * surface.shape * turn.transpose();
    center_shape = CenterShapeFromSurface(surface);
  }
}

template void History<Se2>::Merge(const RowMatrix&, const RowMatrix&);
template void History<Se3>::Merge(const RowMatrix&, const RowMatrix&);

}  // namespace dqslam::online
