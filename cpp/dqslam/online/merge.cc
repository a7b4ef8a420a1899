// What was estimated elsewhere, taken over by a history that has gone on meanwhile.
#include <algorithm>
#include <stdexcept>

#include "dqslam/estimation/bend_path.h"
#include "dqslam/online/history.h"

namespace dqslam::online {

template <typename Pose>
bool History<Pose>::IsElsewhere(const Object& object, const Observation& observation) const {
  if (!observation.IsBox()) return false;
  Eigen::Vector4d box;
  const Surface<double> in_camera =
      ToCamera(StationAt(observation.pose).camera, SurfaceOf(object.center_shape));
  if (!ProjectToBox(in_camera, model.camera, &box)) return true;
  const Eigen::Vector4d& seen = observation.value;
  return std::max(box[0], seen[0]) > std::min(box[2], seen[2]) ||
         std::max(box[1], seen[1]) > std::min(box[3], seen[3]);
}

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
  for (int row = 0; row < num_objects(); ++row) {
    objects[row].Unsettle();
    Vector9d& center_shape = objects[row].center_shape;
    if (row < ellipsoids.rows()) {
      center_shape = CenterShapeFromEllipsoid(ellipsoids.row(row).transpose());
      continue;
    }
    center_shape =
        CenterShapeFromSurface(MoveWith<Pose>(old.data(), now.data(), SurfaceOf(center_shape)));
  }
  for (const Object& object : objects) {
    for (const int row : std::vector<int>(object.deferred)) {
      if (!IsElsewhere(object, observations[row])) Use(row);
    }
  }
}

template bool History<Se2>::IsElsewhere(const Object&, const Observation&) const;
template bool History<Se3>::IsElsewhere(const Object&, const Observation&) const;
template void History<Se2>::Merge(const RowMatrix&, const RowMatrix&);
template void History<Se3>::Merge(const RowMatrix&, const RowMatrix&);

}  // namespace dqslam::online
