// All that a session has been told, and where it stands: tables that only grow at their ends.
#pragma once

#include <vector>

#include "dqslam/initialize.h"
#include "dqslam/online/chart.h"
#include "dqslam/pose.h"

namespace dqslam::online {

/// What one image, or one depth measurement, says of one object.
struct Sight {
  int pose;
  int object;                        ///< -1 for a box that waits: it takes no part
  Eigen::Vector4d value;             ///< box [px], or the centre in the robot frame [m] and a zero
  Eigen::Matrix4d sqrt_information;  ///< whitens the error; of a centre, zero in the last row
  EdgeFlags truncated = EdgeFlags::Constant(false);
  bool is_box = true;

  bool Waits() const { return object < 0; }
};

/// A Gaussian in the chart: cost + g.d + d.H d / 2 at a distance d from `origin`.
struct Quadratic {
  Vector9d origin = Vector9d::Zero();
  Matrix9d H = Matrix9d::Zero();
  Vector9d g = Vector9d::Zero();
  double cost = 0;  ///< at the origin
};

struct Object {
  Vector9d chart = Vector9d::Zero();  ///< zero until it has a place
  SizePrior size;
  Quadratic map;            ///< of a map that was loaded; H = 0 without
  std::vector<int> sights;  ///< rows, ascending
  // What sights say from poses that lie before the window, poses held fixed.
  Quadratic past;
  int past_sights = 0;  ///< how many of `sights` are in it
  int linearized = 0;   ///< of them, when all were linearised last
  bool is_stale = true;
};

template <typename Pose>
struct History {
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Square = Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>;

  struct Step {
    Storage relative;  ///< to this pose from the one before
    Square covariance;
    Square sqrt_information;
    int first_sight;  ///< row of the first sight from this pose
  };

  std::vector<Storage> poses;
  std::vector<Step> steps;  ///< one a pose; of the first pose, its prior
  std::vector<Sight> sights;
  std::vector<Object> objects;
  bool first_pose_is_known = true;

  int num_poses() const { return static_cast<int>(poses.size()); }
  int SightsBefore(int pose) const {
    return pose < num_poses() ? steps[pose].first_sight : static_cast<int>(sights.size());
  }
};

}  // namespace dqslam::online
