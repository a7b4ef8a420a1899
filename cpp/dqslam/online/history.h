// All input of a session and its estimate, as tables that only grow at their ends.
#pragma once

#include <algorithm>
#include <array>
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
  int object;             ///< -1 for a box that waits, which is not used
  int kind = kBox;        ///< or a kind of costs/measurements.h, with m numbers
  Eigen::Vector4d value;  ///< box [px], or the measured numbers and zeros
  EdgeFlags truncated = EdgeFlags::Constant(false);
  bool is_deferred = false;  ///< whether it is not used until a loop is closed

  /// The matrix that whitens the error: lower triangular, zero beyond m rows and columns.
  Eigen::Matrix4d SqrtInformation() const {
    Eigen::Matrix4d W = Eigen::Matrix4d::Zero();
    for (int column = 0, entry = 0; column < 4; ++column) {
      for (int row = column; row < 4; ++row) W(row, column) = lower[entry++];
    }
    return W;
  }
  void SetSqrtInformation(const Eigen::Matrix4d& W) {
    for (int column = 0, entry = 0; column < 4; ++column) {
      for (int row = column; row < 4; ++row) lower[entry++] = W(row, column);
    }
  }

  bool IsBox() const { return kind == kBox; }

  bool IsUsed() const { return object >= 0 && !is_deferred; }

  void SetMeasurement(int new_kind, const Eigen::VectorXd& measured, const RowMatrix& whitening) {
    const Eigen::Index m = measured.size();
    kind = new_kind;
    value.setZero();
    value.head(m) = measured;
    Eigen::Matrix4d W = Eigen::Matrix4d::Zero();
    W.topLeftCorner(m, m) = whitening;
    SetSqrtInformation(W);
  }

 private:
  std::array<double, 10> lower;  ///< triangle of the whitening matrix, column by column
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
  std::vector<int> observations;  ///< rows of those that are used, ascending
  std::vector<int> deferred;      ///< rows of the others, ascending
  // The observations from poses before the window, with these poses constant.
  GaussianPrior marginal;
  int marginalized = 0;  ///< number of `observations` in `marginal`
  int relinearized = 0;  ///< this number when all were linearized last
  bool is_stale = true;  ///< whether changes of poses or labels require linearizing them again
  // The part of it from so old poses that it is not linearized again, which bounds the work.
  GaussianPrior settled;
  int num_settled = 0;  ///< number of `observations` in `settled`

  /// Requires to linearize all observations again.
  void Unsettle() {
    is_stale = true;
    num_settled = 0;
  }

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
  size_t num_deferred = 0;  ///< number of deferred observations
  int settling = 0;         ///< number of the last poses from which observations do not settle

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
      if (!observations[row].IsUsed() || is_listed[object]) continue;
      is_listed[object] = true;
      rows.push_back(object);
    }
    return rows;
  }

  /// A pose in the form that derivatives of observations need.
  Station StationAt(int pose) const { return Station::At<Pose>(poses[pose].data(), model.mount); }

  /// The pose of no motion.
  static Storage Identity() {
    Storage identity;
    const double zero[Pose::kTangentSize] = {};
    Pose::FromTangent(zero, identity.data());
    return identity;
  }

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
  /// observations are added.  Those that are not settled are linearized again if the object is
  /// stale or the number of all has grown by a quarter.  Returns the number of linearized
  /// observations.  In marginal_prior.cc.
  int UpdateMarginalPrior(int begin, Object* object) const;

  /// Replaces the first poses and objects by estimates of another solver; ellipsoids are
  /// log-Cholesky.  Later poses and objects move rigidly with the last of these poses.  Throws
  /// std::invalid_argument, and then nothing has changed.  In merge.cc.
  void Merge(const RowMatrix& estimated_poses, const RowMatrix& ellipsoids);

  /// The history as a problem for Solve(), without objects that have no box.  `rows` has the row in
  /// the history of each object of the problem.  In to_graph.cc.
  Graph ToGraph(std::vector<int>* rows) const;

  /// Whether the predicted box of an object does not even overlap an observed box of it.
  bool IsElsewhere(const Object& object, const Observation& observation) const;

  /// No longer uses an observation of an object, or uses it again.
  void Defer(int row) {
    Object& object = objects[observations[row].object];
    MoveRow(row, &object.observations, &object.deferred);
    observations[row].is_deferred = true;
    object.Unsettle();
    ++num_deferred;
  }
  void Use(int row) {
    Object& object = objects[observations[row].object];
    MoveRow(row, &object.deferred, &object.observations);
    observations[row].is_deferred = false;
    object.Unsettle();
    --num_deferred;
  }

  /// The number of boxes that show each object, with deferred ones.
  IndexVector BoxCounts() const {
    IndexVector counts = IndexVector::Zero(num_objects());
    for (const Observation& one : observations) {
      if (one.IsBox() && one.object >= 0) ++counts[one.object];
    }
    return counts;
  }

 private:
  static void MoveRow(int row, std::vector<int>* from, std::vector<int>* to) {
    from->erase(std::lower_bound(from->begin(), from->end(), row));
    to->insert(std::lower_bound(to->begin(), to->end(), row), row);
  }
};

}  // namespace dqslam::online
