#include "dqslam/online/merge.h"

#include <stdexcept>

namespace dqslam::online {

template <typename Pose>
void Merge(const RowMatrix& poses, const RowMatrix& ellipsoids, History<Pose>* history) {
  using Storage = typename History<Pose>::Storage;
  const int merged = static_cast<int>(poses.rows()), objects = static_cast<int>(ellipsoids.rows());
  const int all_objects = static_cast<int>(history->objects.size());
  if (merged < 1 || merged > history->num_poses() || objects > all_objects ||
      poses.cols() != Pose::kSize || (objects > 0 && ellipsoids.cols() != kLandmarkSize) ||
      !poses.allFinite() || !ellipsoids.allFinite()) {
    throw std::invalid_argument("merge: expected finite poses and objects of this session");
  }
  const Storage old = history->poses[merged - 1];
  const Rigid<double> before = Pose::WorldFromRobot(old.data());
  for (int row = 0; row < merged; ++row) history->poses[row] = poses.row(row).transpose();
  const Storage now = history->poses[merged - 1];
  const Rigid<double> after = Pose::WorldFromRobot(now.data());
  for (int row = merged; row < history->num_poses(); ++row) {
    Storage relative, moved;
    Pose::Between(old.data(), history->poses[row].data(), relative.data());
    Pose::Compose(now.data(), relative.data(), moved.data());
    Pose::Normalize(moved.data());
    history->poses[row] = moved;
  }
  const Eigen::Matrix3d turn = after.rotation * before.rotation.transpose();
  for (int row = 0; row < all_objects; ++row) {
    Object& object = history->objects[row];
    object.is_stale = true;
    if (row < objects) {
      object.center_shape = CenterShapeFromEllipsoid(ellipsoids.row(row).transpose());
      continue;
    }
    Surface<double> surface = SurfaceOf(object.center_shape);
    surface.center = turn * (surface.center - before.translation) + after.translation;
    surface.shape = turn * surface.shape * turn.transpose();
    object.center_shape = CenterShapeFromSurface(surface);
  }
}

template void Merge<Se2>(const RowMatrix&, const RowMatrix&, History<Se2>*);
template void Merge<Se3>(const RowMatrix&, const RowMatrix&, History<Se3>*);

}  // namespace dqslam::online
