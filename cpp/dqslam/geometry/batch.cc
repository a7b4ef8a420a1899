#include "dqslam/geometry/batch.h"

#include <limits>
#include <stdexcept>
#include <string>

#include "dqslam/geometry/dispatch.h"

namespace dqslam {
namespace {

void RequireShape(const char* name,
                  const RowMatrix& table,
                  Eigen::Index rows,
                  Eigen::Index columns) {
  if (table.rows() == rows && table.cols() == columns) return;
  throw std::invalid_argument(std::string(name) + " has shape (" + std::to_string(table.rows()) +
                              ", " + std::to_string(table.cols()) + "), expected (" +
                              std::to_string(rows) + ", " + std::to_string(columns) + ")");
}

}  // namespace

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
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("poses", poses, poses.rows(), Pose::kSize);
    RowMatrix result(poses.rows(), Se3::kSize);
    const Mount mount(camera);
    for (Eigen::Index i = 0; i < poses.rows(); ++i) {
      const CameraInWorld<double> located = LocateCamera<Pose>(poses.row(i).data(), mount);
      const Eigen::Quaterniond rotation(Eigen::Matrix3d(located.camera_from_world.transpose()));
      result.row(i) << located.position.transpose(), rotation.normalized().coeffs().transpose();
    }
    return result;
  });
}

std::pair<RowMatrix, Mask> ProjectToBoxesRows(PoseModel model,
                                              const Camera& camera,
                                              const RowMatrix& poses,
                                              const RowMatrix& ellipsoids) {
  return Dispatch(model, [&](auto pose) {
    using Pose = decltype(pose);
    RequireShape("poses", poses, poses.rows(), Pose::kSize);
    RequireShape("ellipsoids", ellipsoids, poses.rows(), kLandmarkSize);
    RowMatrix boxes(poses.rows(), kBoxSize);
    Mask in_front(poses.rows());
    const Mount mount(camera);
    for (Eigen::Index i = 0; i < poses.rows(); ++i) {
      Eigen::Vector4d box;
      in_front[i] = ProjectToBox(ToCamera(LocateCamera<Pose>(poses.row(i).data(), mount),
                                          EllipsoidModel::Unpack(ellipsoids.row(i).data())),
                                 camera,
                                 &box);
      if (!in_front[i]) box.setConstant(std::numeric_limits<double>::quiet_NaN());
      boxes.row(i) = box;
    }
    return std::make_pair(boxes, in_front);
  });
}

}  // namespace dqslam
