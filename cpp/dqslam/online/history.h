// All input of a session and its estimate, as tables that only grow at their ends.
#pragma once

#include <algorithm>
#include <vector>

#include "dqslam/estimation/initialize.h"
#include "dqslam/geometry/box_derivatives.h"
#include "dqslam/geometry/center_shape.h"
#include "dqslam/problem/graph.h"

namespace dqslam::online {

/// The data that all residuals share.
struct Model {
  Model(const Camera& camera, const ScenePriors& scene, double loss_scale)
      : camera(camera), mount(camera), scene(scene), loss_scale(loss_scale) {}
  Camera camera;
  Mount mount;
  ScenePriors scene;
  double loss_scale;  ///< of the Cauchy loss, in sigmas of a box; 0 for least squares
};

/// A box of an object, or another measurement of it.
struct Observation {
  static constexpr int kBox = -1;

  int pose;
  int object;                        ///< -1 for a box that waits, which is not used
  int kind = kBox;                   ///< or a kind of costs/measurements.h, with m numbers
  Eigen::Vector4d value;             ///< box [px], or the measured numbers and zeros
  Eigen::Matrix4d sqrt_information;  ///< whitens the error; zero beyond m rows and columns
  EdgeFlags truncated = EdgeFlags::Constant(false);

  bool IsBox() const { return kind == kBox; }

  bool Waits() const { return object < 0; }

  void SetMeasurement(int new_kind, const Eigen::VectorXd& measured, const RowMatrix& whitening) {
    const Eigen::Index m = measured.size();
    kind = new_kind;
    value.setZero();
    value.head(m) = measured;
    sqrt_information.setZero();
    sqrt_information.topLeftCorner(m, m) = whitening;
  }
};

/// A Gaussian in center and shape.  Its cost is cost + g.d + d.H d / 2 at `origin` + d.
struct GaussianPrior {
  Vector9d origin = Vector9d::Zero();
  Matrix9d H = Matrix9d::Zero();
  Vector9d g = Vector9d::Zero();
  double cost = 0;  ///< at the origin

  double CostAt(const Vector9d& center_shape) const {
    const Vector9d d = center_shape - origin;
    return cost + g.dot(d) + 0.5 * d.dot(H * d);
  }
  Vector9d GradientAt(const Vector9d& center_shape) const {
    return g + H * (center_shape - origin);
  }
};

struct Object {
  Vector9d center_shape = Vector9d::Zero();  ///< zero until the object is initialized
  SizePrior size;
  GaussianPrior map;              ///< prior of a loaded map; H = 0 without one
  std::vector<int> observations;  ///< rows, ascending
  // The observations from poses before the window, with these poses constant.
  GaussianPrior marginal;
  int marginalized = 0;  ///< number of `observations` in `marginal`
  int relinearized = 0;  ///< this number when all were linearized last
  bool is_stale = true;  ///< whether changes of poses or labels require linearizing all again

  bool IsOfMap() const { return !map.H.isZero(0); }
};

template <typename Pose>
struct History {
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Square = Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>;

  struct Step {
    Storage relative;  ///< this pose relative to the one before
    Square covariance;
    Square sqrt_information;
    int first_observation;  ///< row of the first observation from this pose
  };

  explicit History(const Model& model) : model(model) {}

  Model model;
  std::vector<Storage> poses;
  std::vector<Step> steps;  ///< one per pose; that of the first pose is its prior
  std::vector<Observation> observations;
  std::vector<Object> objects;
  bool first_pose_is_known = true;

  int num_poses() const { return static_cast<int>(poses.size()); }
  int num_objects() const { return static_cast<int>(objects.size()); }
  int num_observations() const { return static_cast<int>(observations.size()); }

  int ObservationsBefore(int pose) const {
    return pose < num_poses() ? steps[pose].first_observation : num_observations();
  }

  /// Rows of the objects that are observed from poses from `begin` on, each once.
  std::vector<int> ObjectsSeenFrom(int begin) const {
    std::vector<int> rows;
    std::vector<bool> is_listed(objects.size(), false);
    for (int row = ObservationsBefore(begin); row < num_observations(); ++row) {
      const int object = observations[row].object;
      if (object < 0 || is_listed[object]) continue;
      is_listed[object] = true;
      rows.push_back(object);
    }
    return rows;
  }

  /// A pose in the form that derivatives of observations need.
  Station StationAt(int pose) const { return Station::At<Pose>(poses[pose].data(), model.mount); }

  static Storage Compose(const Storage& from, const Storage& relative) {
    Storage to;
    Pose::Compose(from.data(), relative.data(), to.data());
    Pose::Normalize(to.data());
    return to;
  }

  static Storage Retract(const Storage& from,
                         const Eigen::Matrix<double, Pose::kTangentSize, 1>& step) {
    Storage relative;
    Pose::FromTangent(step.data(), relative.data());
    return Compose(from, relative);
  }

  /// Sets the poses from `begin` on to their odometry, starting at the pose before.
  void DeadReckon(int begin) {
    for (int pose = std::max(begin, 1); pose < num_poses(); ++pose)
      poses[pose] = Compose(poses[pose - 1], steps[pose].relative);
  }

  /// Updates the marginal prior of an object to its observations before the pose `begin`.  New
  /// observations are added.  All are linearized again if the object is stale or their number has
  /// grown by a quarter.  Returns the number of linearized observations.  In marginal_prior.cc.
  int UpdateMarginalPrior(int begin, Object* object) const;

  /// Replaces the first poses and objects by estimates of another solver; ellipsoids are
  /// log-Cholesky.  Later poses and objects move rigidly with the last of these poses.  Throws
  /// std::invalid_argument, and then nothing has changed.  In merge.cc.
  void Merge(const RowMatrix& estimated_poses, const RowMatrix& ellipsoids);

  /// The history as a problem for Solve(), without objects that have no box.  `rows` has the row in
  /// the history of each object of the problem.  In to_graph.cc.
  Graph ToGraph(std::vector<int>* rows) const;

  /// The number of boxes that show each object.
  IndexVector BoxCounts() const {
    IndexVector counts = IndexVector::Zero(num_objects());
    for (const Observation& one : observations) {
      if (one.IsBox() && !one.Waits()) ++counts[one.object];
    }
    return counts;
  }
};

}  // namespace dqslam::online
