// All that a session has been told, and where it stands: tables that only grow at their ends.
#pragma once

#include <vector>

#include "dqslam/estimation/initialize.h"
#include "dqslam/geometry/center_shape.h"
#include "dqslam/geometry/pose.h"

namespace dqslam::online {

/// What one image, or one depth measurement, says of one object.
struct Observation {
  int pose;
  int object;                        ///< -1 for a box that waits: it takes no part
  Eigen::Vector4d value;             ///< box [px], or the center in the robot frame [m] and a zero
  Eigen::Matrix4d sqrt_information;  ///< whitens the error; of a center, zero in the last row
  EdgeFlags truncated = EdgeFlags::Constant(false);
  bool is_box = true;
  int kind = 0;  ///< of a measurement that is no box, see costs/measurements.h

  bool Waits() const { return object < 0; }
};

/// A Gaussian in the center_shape: cost + g.d + d.H d / 2 at a distance d from `origin`.
struct GaussianPrior {
  Vector9d origin = Vector9d::Zero();
  Matrix9d H = Matrix9d::Zero();
  Vector9d g = Vector9d::Zero();
  double cost = 0;  ///< at the origin
};

struct Object {
  Vector9d center_shape = Vector9d::Zero();  ///< zero until it has a place
  SizePrior size;
  GaussianPrior map;              ///< of a map that was loaded; H = 0 without
  std::vector<int> observations;  ///< rows, ascending
  // What observations say from poses that lie before the window, poses held fixed.
  GaussianPrior marginal;
  int marginalized_observations = 0;  ///< how many of `observations` are in it
  int linearized = 0;                 ///< of them, when all were linearized last
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
    int first_observation;  ///< row of the first observation from this pose
  };

  std::vector<Storage> poses;
  std::vector<Step> steps;  ///< one a pose; of the first pose, its prior
  std::vector<Observation> observations;
  std::vector<Object> objects;
  bool first_pose_is_known = true;

  int num_poses() const { return static_cast<int>(poses.size()); }
  int ObservationsBefore(int pose) const {
    return pose < num_poses() ? steps[pose].first_observation
                              : static_cast<int>(observations.size());
  }
};

}  // namespace dqslam::online
