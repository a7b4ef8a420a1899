// Tables of ellipsoids, cuboids and cylinders, row by row as the camera of a pose has them.
#pragma once

#include <utility>
#include <vector>

#include "dqslam/geometry/batch.h"
#include "dqslam/geometry/body.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/geometry/ellipsoid.h"

namespace dqslam {

/// Cuboids and cylinders in the world, see body.h.
struct BodyTable {
  std::vector<Shape> shapes;
  RowMatrix centers;  ///< c [m], shape (n, 3)
  RowMatrix factors;  ///< A [m] row by row, shape (n, 9)

  /// Throws std::invalid_argument unless there are so many bodies and none is an ellipsoid.
  void Check(Eigen::Index rows) const;
  /// With edges as little rounded as the estimator's.
  Body<double> Row(Eigen::Index i) const;
};

/// Calls visit(i, camera) with the camera of each pose in the world.
template <typename Visit>
void ForEachCamera(PoseModel model,
                   const Camera& camera,
                   const RowMatrix& poses,
                   const Visit& visit) {
  Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("poses", poses, poses.rows(), Pose::kSize);
    const Mount mount(camera);
    for (Eigen::Index i = 0; i < poses.rows(); ++i) {
      visit(i, LocateCamera<Pose>(poses.row(i).data(), mount));
    }
  });
}

/// Calls visit(i, object) with ellipsoid i, of parameters (n, 9), as the camera of pose i has it.
template <typename Visit>
void ForEachInCamera(PoseModel model,
                     const Camera& camera,
                     const RowMatrix& poses,
                     const RowMatrix& ellipsoids,
                     const Visit& visit) {
  RequireShape("ellipsoids", ellipsoids, poses.rows(), kLandmarkSize);
  ForEachCamera(model, camera, poses, [&](Eigen::Index i, const auto& located) {
    visit(i, ToCamera(located, EllipsoidModel::Unpack(ellipsoids.row(i).data())));
  });
}

/// The same with body i.
template <typename Visit>
void ForEachInCamera(PoseModel model,
                     const Camera& camera,
                     const RowMatrix& poses,
                     const BodyTable& bodies,
                     const Visit& visit) {
  bodies.Check(poses.rows());
  ForEachCamera(model, camera, poses, [&](Eigen::Index i, const auto& located) {
    visit(i, ToCamera(located, bodies.Row(i)));
  });
}

/// Box of body i from pose i, as that of an ellipsoid.
std::pair<RowMatrix, Mask> ProjectToBoxesRows(PoseModel model,
                                              const Camera& camera,
                                              const RowMatrix& poses,
                                              const BodyTable& bodies);

}  // namespace dqslam
