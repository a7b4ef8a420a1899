#include "dqslam/geometry/batch.h"

#include <algorithm>
#include <limits>

#include "dqslam/geometry/box_derivatives.h"
#include "dqslam/geometry/objects_in_camera.h"
#include "dqslam/geometry/outline.h"

namespace dqslam {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <typename Landmark>
RowMatrix ShapeRows(const char* name, const RowMatrix& landmarks) {
  RequireShape(name, landmarks, landmarks.rows(), kLandmarkSize);
  RowMatrix shapes(3 * landmarks.rows(), 3);
  for (Eigen::Index i = 0; i < landmarks.rows(); ++i) {
    shapes.middleRows<3>(3 * i) = Landmark::Unpack(landmarks.row(i).data()).shape;
  }
  return shapes;
}

template <typename Objects>
std::pair<RowMatrix, Mask> ProjectToBoxes(PoseModel model,
                                          const Camera& camera,
                                          const RowMatrix& poses,
                                          const Objects& objects) {
  RowMatrix boxes = RowMatrix::Constant(poses.rows(), kBoxSize, kNan);
  Mask in_front(poses.rows());
  ForEachInCamera(model, camera, poses, objects, [&](Eigen::Index i, const auto& object) {
    Eigen::Vector4d box;
    in_front[i] = ProjectToBox(object, camera, &box);
    if (in_front[i]) boxes.row(i) = box;
  });
  return {boxes, in_front};
}

}  // namespace

void BodyTable::Check(Eigen::Index rows) const {
  RequireShape("centers", centers, rows, 3);
  RequireShape("factors", factors, rows, 9);
  if (static_cast<Eigen::Index>(shapes.size()) != rows ||
      std::count(shapes.begin(), shapes.end(), Shape::kEllipsoid) > 0) {
    throw std::invalid_argument("shapes: expected a cuboid or a cylinder for each of " +
                                std::to_string(rows) + " poses");
  }
}

Body<double> BodyTable::Row(Eigen::Index i) const {
  return {shapes[i],
          RoundedModel(shapes[i]).rounding,
          centers.row(i),
          Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(factors.row(i).data())};
}

RowMatrix ComposeRows(PoseModel model, const RowMatrix& a, const RowMatrix& b) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("a_from_b", a, a.rows(), Pose::kSize);
    RequireShape("b_from_c", b, a.rows(), Pose::kSize);
    RowMatrix result(a.rows(), Pose::kSize);
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      Pose::Compose(a.row(i).data(), b.row(i).data(), result.row(i).data());
      Pose::Normalize(result.row(i).data());
    }
    return result;
  });
}

RowMatrix BetweenRows(PoseModel model, const RowMatrix& a, const RowMatrix& b) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("a_from_b", a, a.rows(), Pose::kSize);
    RequireShape("a_from_c", b, a.rows(), Pose::kSize);
    RowMatrix result(a.rows(), Pose::kSize);
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      Pose::Between(a.row(i).data(), b.row(i).data(), result.row(i).data());
      Pose::Normalize(result.row(i).data());
    }
    return result;
  });
}

RowMatrix InverseRows(PoseModel model, const RowMatrix& a_from_b) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    const double still[Pose::kTangentSize] = {};
    Eigen::Matrix<double, 1, Pose::kSize> identity;
    Pose::FromTangent(still, identity.data());
    return BetweenRows(model, a_from_b, identity.replicate(a_from_b.rows(), 1));
  });
}

RowMatrix AdjointRows(PoseModel model, const RowMatrix& a_from_b) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    constexpr int k = Pose::kTangentSize;
    RequireShape("a_from_b", a_from_b, a_from_b.rows(), Pose::kSize);
    RowMatrix adjoints(k * a_from_b.rows(), k);
    for (Eigen::Index i = 0; i < a_from_b.rows(); ++i) {
      adjoints.middleRows<k>(k * i) = Adjoint<Pose>(a_from_b.row(i).data());
    }
    return adjoints;
  });
}

RowMatrix PlusRows(PoseModel model, const RowMatrix& poses, const RowMatrix& tangents) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("poses", poses, poses.rows(), Pose::kSize);
    RequireShape("tangents", tangents, poses.rows(), Pose::kTangentSize);
    RowMatrix result(poses.rows(), Pose::kSize);
    for (Eigen::Index i = 0; i < poses.rows(); ++i) {
      Plus<Pose>(poses.row(i).data(), tangents.row(i).data(), result.row(i).data());
      Pose::Normalize(result.row(i).data());
    }
    return result;
  });
}

RowMatrix MinusRows(PoseModel model, const RowMatrix& poses, const RowMatrix& origins) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("poses", poses, poses.rows(), Pose::kSize);
    RequireShape("origins", origins, poses.rows(), Pose::kSize);
    RowMatrix result(poses.rows(), Pose::kTangentSize);
    for (Eigen::Index i = 0; i < poses.rows(); ++i) {
      Minus<Pose>(poses.row(i).data(), origins.row(i).data(), result.row(i).data());
    }
    return result;
  });
}

RowMatrix DeadReckonRows(PoseModel model, const Eigen::VectorXd& first, const RowMatrix& relative) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("first", first.transpose(), 1, Pose::kSize);
    RequireShape("relative", relative, relative.rows(), Pose::kSize);
    RowMatrix result(relative.rows() + 1, Pose::kSize);
    result.row(0) = first;
    for (Eigen::Index i = 0; i < relative.rows(); ++i) {
      Pose::Compose(result.row(i).data(), relative.row(i).data(), result.row(i + 1).data());
      Pose::Normalize(result.row(i + 1).data());
    }
    return result;
  });
}

RowMatrix WorldFromCameraRows(PoseModel model, const Camera& camera, const RowMatrix& poses) {
  RowMatrix result(poses.rows(), Se3::kSize);
  ForEachCamera(model, camera, poses, [&](Eigen::Index i, const CameraInWorld<double>& located) {
    const Eigen::Quaterniond rotation(Eigen::Matrix3d(located.camera_from_world.transpose()));
    result.row(i) << located.position.transpose(), rotation.normalized().coeffs().transpose();
  });
  return result;
}

std::pair<RowMatrix, Mask> ProjectToBoxesRows(PoseModel model,
                                              const Camera& camera,
                                              const RowMatrix& poses,
                                              const RowMatrix& ellipsoids) {
  return ProjectToBoxes(model, camera, poses, ellipsoids);
}

std::pair<RowMatrix, Mask> ProjectToBoxesRows(PoseModel model,
                                              const Camera& camera,
                                              const RowMatrix& poses,
                                              const BodyTable& bodies) {
  return ProjectToBoxes(model, camera, poses, bodies);
}

BoolTable EdgesOutOfSightRows(PoseModel model,
                              const Camera& camera,
                              const RowMatrix& poses,
                              const RowMatrix& ellipsoids) {
  BoolTable out_of_sight = BoolTable::Constant(poses.rows(), kBoxSize, true);
  ForEachInCamera(model, camera, poses, ellipsoids, [&](Eigen::Index i, const auto& surface) {
    Eigen::Vector4d box;
    if (!ProjectToBox(surface, camera, &box)) return;
    const EdgeFlags flags = EdgesOutOfSight(surface, camera, box);
    out_of_sight.block<1, kBoxSize>(i, 0) = flags.transpose();
  });
  return out_of_sight;
}

std::tuple<RowMatrix, Mask, RowMatrix> DifferentiateBoxesRows(PoseModel model,
                                                              const Camera& camera,
                                                              const RowMatrix& poses,
                                                              const RowMatrix& ellipsoids) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    constexpr int k = Pose::kTangentSize;
    RequireShape("poses", poses, poses.rows(), Pose::kSize);
    RequireShape("ellipsoids", ellipsoids, poses.rows(), kLandmarkSize);
    RowMatrix boxes = RowMatrix::Constant(poses.rows(), kBoxSize, kNan);
    RowMatrix jacobians = RowMatrix::Constant(kBoxSize * poses.rows(), k + kLandmarkSize, kNan);
    Mask in_front(poses.rows());
    const Mount mount(camera);
    for (Eigen::Index i = 0; i < poses.rows(); ++i) {
      const Station station = Station::At<Pose>(poses.row(i).data(), mount);
      const Unpacked<EllipsoidModel> ellipsoid(ellipsoids.row(i).data());
      Eigen::Vector4d box;
      EdgeDerivatives edges;
      in_front[i] =
          DifferentiateBox(ToCamera(station.camera, ellipsoid.surface), camera, &box, &edges);
      if (!in_front[i]) continue;
      Eigen::Matrix<double, kBoxSize, k> by_pose;
      Eigen::Matrix<double, kBoxSize, kLandmarkSize> by_ellipsoid;
      ByPoseAndLandmark<Pose>(edges, station, mount, ellipsoid, &by_pose, &by_ellipsoid);
      boxes.row(i) = box;
      jacobians.middleRows<kBoxSize>(kBoxSize * i) << by_pose, by_ellipsoid;
    }
    return std::make_tuple(boxes, in_front, jacobians);
  });
}

RowMatrix ProjectToOutlinesRows(PoseModel model,
                                const Camera& camera,
                                const RowMatrix& poses,
                                const RowMatrix& ellipsoids,
                                int points) {
  if (points < 2) throw std::invalid_argument("points: an outline needs at least 2");
  RowMatrix outlines = RowMatrix::Constant(points * poses.rows(), 2, kNan);
  ForEachInCamera(model, camera, poses, ellipsoids, [&](Eigen::Index i, const auto& surface) {
    RowMatrix outline;
    if (!ProjectToOutline(surface, camera, points, &outline)) return;
    outlines.middleRows(points * i, points) = outline;
  });
  return outlines;
}

RowMatrix EllipsoidShapeRows(const RowMatrix& ellipsoids) {
  return ShapeRows<EllipsoidModel>("ellipsoids", ellipsoids);
}

RowMatrix DualQuadricShapeRows(const RowMatrix& quadrics) {
  return ShapeRows<DualQuadricModel>("quadrics", quadrics);
}

}  // namespace dqslam
