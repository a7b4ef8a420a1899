// Estimation step by step: bounded work at each, an estimate at any time.
//
// At a step the last poses and the objects they saw are minimized, poses before them constant and
// the observations from there kept as Gaussians on the objects.  Now and then more poses are, so
// that nothing stays frozen where it was first put; an object that comes back after an absence, and
// does not fit, frees all poses since it was seen last.
#pragma once

#include <memory>

#include "dqslam/online/observations.h"
#include "dqslam/online/options.h"

namespace dqslam::online {

/// What a step cost.
struct StepReport {
  int pose = 0;                   ///< row of the new pose
  int first_observation = 0;      ///< row of its first: boxes as they were given, then positions
  int window_poses = 0;           ///< poses of the window
  int window_objects = 0;         ///< objects that it saw
  int linearized = 0;             ///< observations, in the window and to keep what lies before it
  int undefined = 0;              ///< observations of the window whose objects are not in front
  double chi_square = 0;          ///< of the window, per residual: 1 where the model is right
  int smoothed_poses = 0;         ///< poses minimized beside the window; 0 at most steps
  int smoothed_observations = 0;  ///< observations linearized there
  bool closed_loop = false;       ///< a loop that did not fit was solved
  bool recovered = false;         ///< the last poses and their young objects were started again
};

class Session {
 public:
  static std::unique_ptr<Session> Make(PoseModel pose_model,
                                       const Camera& camera,
                                       const ScenePriors& scene,
                                       const OnlineOptions& options);
  virtual ~Session() = default;
  virtual std::unique_ptr<Session> Clone() const = 0;

  /// Adds a pose and what it saw.  The first one's `relative` is the pose itself, known exactly
  /// where its covariance is empty.  Throws std::invalid_argument, and then nothing has changed.
  virtual StepReport Add(const Eigen::VectorXd& relative,
                         const RowMatrix& covariance,
                         const StepObservations& observations) = 0;

  /// An object of a map that is known: log-Cholesky parameters and their covariance (9, 9).
  virtual void AddMapObject(const Vector9d& ellipsoid,
                            const Matrix9d& covariance,
                            const SizePrior& size) = 0;

  /// Moves boxes from object to object.  No object changes its place, but those that had none have
  /// one now.  Throws std::invalid_argument, and then nothing has changed.
  virtual void Relabel(const NewLabels& labels) = 0;

  /// Multiplies the standard deviations of all steps, but not of the first pose, by two factors.
  virtual void ScaleOdometry(double translation, double rotation) = 0;

  /// Levenberg-Marquardt on all poses from `begin` on, priors of the map included; returns the
  /// cost.
  virtual double Smooth(int iterations, int begin) = 0;

  /// Takes over what was estimated elsewhere of the first poses and objects.  Later ones move
  /// rigidly with the last of these poses.
  virtual void Merge(const RowMatrix& poses, const RowMatrix& ellipsoids) = 0;

  /// All of it as a problem for Solve(): objects without a box take no part, and `rows` has
  /// the row of each that does.
  virtual Graph ToGraph(std::vector<int>* rows) const = 0;

  virtual int num_poses() const = 0;
  virtual int num_objects() const = 0;
  virtual Eigen::VectorXd PoseAt(int row) const = 0;
  virtual RowMatrix Poses() const = 0;                           ///< (poses, d)
  virtual RowMatrix PosesAt(const IndexVector& rows) const = 0;  ///< (n, d)
  virtual RowMatrix Ellipsoids() const = 0;      ///< (objects, 9) log-Cholesky parameters
  virtual IndexVector Observations() const = 0;  ///< boxes of each object
};

}  // namespace dqslam::online
