// Estimation step by step, with bounded work at each step and an estimate at any time.
//
// A step minimizes the last poses and the objects that were observed from them.  Earlier poses are
// constant, and observations from them are kept as Gaussians on the objects.  Smoothings minimize
// more poses from time to time.  If an object is observed again after an absence and does not fit,
// all poses since its last observation are minimized, see loop_closing.h.
#pragma once

#include <memory>

#include "dqslam/online/observations.h"
#include "dqslam/online/options.h"

namespace dqslam::online {

/// The work and the fit of a step.
struct StepReport {
  int pose = 0;                   ///< row of the new pose
  int first_observation = 0;      ///< row of its first one: boxes in order, then positions
  int window_poses = 0;           ///< number of poses of the window
  int window_objects = 0;         ///< number of objects observed from them
  int linearized = 0;             ///< linearized observations, in the window and before it
  int undefined = 0;              ///< the window's observations of objects not in front
  double chi_square = 0;          ///< of the window, per residual; 1 if the model is right
  int smoothed_poses = 0;         ///< number of poses of a smoothing; 0 at most steps
  int smoothed_observations = 0;  ///< number of observations that it linearized
  bool closed_loop = false;       ///< whether a loop that did not fit was solved
  bool recovered = false;  ///< whether the last poses and their young objects were reinitialized
  RowMatrix covariance;    ///< of the new pose in its tangent, (k, k)
};

class Session {
 public:
  static std::unique_ptr<Session> Make(PoseModel pose_model,
                                       const Camera& camera,
                                       const ScenePriors& scene,
                                       const OnlineOptions& options);
  virtual ~Session() = default;
  virtual std::unique_ptr<Session> Clone() const = 0;

  /// Adds a pose and its observations.  For the first pose, `relative` is the pose itself, which is
  /// known exactly if its covariance is empty.  Throws std::invalid_argument, and then nothing has
  /// changed.
  virtual StepReport Add(const Eigen::VectorXd& relative,
                         const RowMatrix& covariance,
                         const StepObservations& observations) = 0;

  /// Adds an object of a known map, with log-Cholesky parameters and their covariance (9, 9).
  virtual void AddMapObject(const Vector9d& ellipsoid,
                            const Matrix9d& covariance,
                            const SizePrior& size) = 0;

  /// Moves boxes from object to object.  Objects that have a place keep it; others get one.  Throws
  /// std::invalid_argument, and then nothing has changed.
  virtual void Relabel(const NewLabels& labels) = 0;

  /// Multiplies the standard deviations of all steps, but not of the first pose, by two factors.
  virtual void ScaleOdometry(double translation, double rotation) = 0;

  /// Minimizes all poses from `begin` on by Levenberg-Marquardt, with the priors of the map.
  /// Returns the cost.
  virtual double Smooth(int iterations, int begin) = 0;

  /// Replaces the first poses and objects by estimates of another solver.  Later poses and objects
  /// move rigidly with the last of these poses.
  virtual void Merge(const RowMatrix& poses, const RowMatrix& ellipsoids) = 0;

  /// The session as a problem for Solve(), without objects that have no box.  `rows` has the row in
  /// the session of each object of the problem.
  virtual Graph ToGraph(std::vector<int>* rows) const = 0;

  virtual int num_poses() const = 0;
  virtual int num_objects() const = 0;
  virtual Eigen::VectorXd PoseAt(int row) const = 0;
  virtual RowMatrix LastCovariance() const = 0;  ///< of the last pose in its tangent, (k, k)
  virtual RowMatrix Poses() const = 0;           ///< (poses, d)
  virtual RowMatrix PosesAt(const IndexVector& rows) const = 0;  ///< (n, d)
  virtual RowMatrix Ellipsoids() const = 0;      ///< (objects, 9) log-Cholesky parameters
  virtual IndexVector Observations() const = 0;  ///< number of boxes of each object
};

}  // namespace dqslam::online
