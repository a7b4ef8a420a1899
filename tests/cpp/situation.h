// One box of one object, and every cost of it.
#pragma once

#include "cost_checks.h"
#include "dqslam/costs/algebraic.h"
#include "dqslam/costs/box.h"
#include "dqslam/costs/relative_position.h"
#include "dqslam/costs/tangent.h"
#include "oracle.h"
#include "random.h"

namespace dqslam {

/// A camera on a robot, an ellipsoid in front of it and a box that nearly fits.
template <typename Pose, typename Landmark>
struct Situation {
  explicit Situation(Random& random) : mount(MakeCamera(&camera, random)) {
    pose = random.RandomPose<Pose>();
    const CameraInWorld<double> located = LocateCamera<Pose>(pose.data(), mount);
    view = {located.camera_from_world.transpose(), located.position};
    Place({random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(3, 8)}, random);
    observed = oracle::Box(camera, view, ellipsoid) + random.UniformVector<4>(-20, 20);
  }

  void Place(const Eigen::Vector3d& in_camera, Random& random) {
    ellipsoid = {view.rotation * in_camera + view.position,
                 random.UniformVector<3>(0.2, 1),
                 random.UnitQuaternion()};
    const Vector9d e =
        EllipsoidFromAxes(ellipsoid.center, ellipsoid.semi_axes, ellipsoid.orientation_xyzw);
    const bool constrained = Landmark::kModel == LandmarkModel::kEllipsoid;
    landmark = constrained ? e : DualQuadricFromEllipsoid(e);
  }

  std::vector<Block> Blocks() const { return {PoseBlock<Pose>(pose), LandmarkBlock(landmark)}; }

  CostPointer Algebraic(const Eigen::Matrix4d& weight, bool normalized) const {
    return CostPointer(AlgebraicCost<Pose, Landmark>::Create(
        mount, BoxLines(camera, observed), weight, normalized));
  }
  CostPointer Tangent(const Eigen::Matrix4d& weight,
                      double depth = 4,
                      const EdgeFlags& one_sided = EdgeFlags::Constant(false)) const {
    return CostPointer(
        TangentCost<Pose, Landmark>::Create(camera, mount, observed, weight, depth, one_sided));
  }
  CostPointer Box(const Eigen::Matrix4d& weight,
                  const EdgeFlags& one_sided = EdgeFlags::Constant(false)) const {
    return CostPointer(BoxCost<Pose, Landmark>::Create(camera, mount, observed, weight, one_sided));
  }
  CostPointer Position(const Eigen::Matrix3d& weight) const {
    return CostPointer(
        RelativePositionCost<Pose, Landmark>::Create(Eigen::Vector3d(1, -2, 3), weight));
  }

  static Mount MakeCamera(Camera* camera, Random& random) {
    camera->fx = 500;
    camera->fy = 450;
    camera->cx = 320;
    camera->cy = 240;
    camera->width = 640;
    camera->height = 480;
    camera->robot_from_camera << random.UniformVector<3>(-0.5, 0.5), random.UnitQuaternion();
    return Mount(*camera);
  }

  Camera camera;
  Mount mount;
  Eigen::Matrix<double, Pose::kSize, 1> pose;
  oracle::Viewpoint view;
  oracle::Ellipsoid ellipsoid;
  Vector9d landmark;
  Eigen::Vector4d observed;
};

}  // namespace dqslam
