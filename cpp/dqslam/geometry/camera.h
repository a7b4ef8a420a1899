// Pinhole camera with Brown-Conrady distortion, rigidly mounted on the robot.
// Estimation uses undistorted boxes, which are converted once, when they are read.
#pragma once

#include <Eigen/Core>

#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/pose.h"

namespace dqslam {

struct Camera {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  int width = 0, height = 0;              ///< pixels
  /// k1 k2 p1 p2 k3, in the order of OpenCV.
  Eigen::Matrix<double, 5, 1> distortion = Eigen::Matrix<double, 5, 1>::Zero();
  /// SE(3) pose of the camera on the robot, [tx ty tz qx qy qz qw].
  Eigen::Matrix<double, 7, 1> robot_from_camera =
      (Eigen::Matrix<double, 7, 1>() << 0, 0, 0, 0, 0, 0, 1).finished();

  /// Whether a pixel lies in the image, see blocks.h.
  bool Shows(double u, double v) const {
    return u >= -0.5 && v >= -0.5 && u <= width - 0.5 && v <= height - 0.5;
  }
  bool HasDistortion() const { return !distortion.isZero(0.0); }

  /// Throws std::invalid_argument unless focal lengths and sizes are positive, all numbers are
  /// finite and the mount is a rigid transform.
  void Validate() const;

  /// Ideal pinhole pixels of distorted pixels, shape (n, 2).  Throws std::invalid_argument if the
  /// distortion cannot be inverted at a pixel.
  RowMatrix UndistortPoints(const RowMatrix& distorted) const;
  /// Distorted pixels of ideal pinhole pixels, shape (n, 2).
  RowMatrix DistortPoints(const RowMatrix& undistorted) const;
  /// Undistorted boxes, shape (n, 4).  Each edge is undistorted at its middle, where objects
  /// usually touch it.
  RowMatrix UndistortBoxes(const RowMatrix& distorted) const;
  /// Distorted boxes, shape (n, 4).  This inverts UndistortBoxes to a small part of a pixel.
  RowMatrix DistortBoxes(const RowMatrix& undistorted) const;
};

/// Position and orientation of a camera, in the form that costs need.
template <typename T>
struct CameraInWorld {
  Matrix3<T> camera_from_world;  ///< rotation
  Vector3<T> position;           ///< of the camera, in the world
};

/// The mount of the camera on the robot, in the form that costs need.
struct Mount {
  explicit Mount(const Camera& camera) {
    const Rigid<double> robot_from_camera = Se3::WorldFromRobot(camera.robot_from_camera.data());
    camera_from_robot = robot_from_camera.rotation.transpose();
    camera_in_robot = robot_from_camera.translation;
  }
  Matrix3<double> camera_from_robot;  ///< rotation
  Vector3<double> camera_in_robot;
};

template <typename Pose, typename T>
CameraInWorld<T> LocateCamera(const T* pose, const Mount& mount) {
  const Rigid<T> world_from_robot = Pose::WorldFromRobot(pose);
  CameraInWorld<T> camera;
  camera.camera_from_world = mount.camera_from_robot * world_from_robot.rotation.transpose();
  camera.position =
      world_from_robot.translation + world_from_robot.rotation * mount.camera_in_robot;
  return camera;
}

}  // namespace dqslam
