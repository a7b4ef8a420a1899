// Minimization of the last poses and of all objects observed from them.  Older poses are constant.
#pragma once

#include <optional>
#include <vector>

#include "dqslam/linear/block_cholesky.h"
#include "dqslam/linear/normal_equations.h"
#include "dqslam/online/linearize.h"
#include "dqslam/online/options.h"

namespace dqslam::online {

/// The first damping, relative to the diagonal of the normal equations.  The motion of a long chain
/// of poses as a whole has little curvature.  With more damping, it would converge very slowly.
inline constexpr double kFirstDamping = 1e-8;

/// Whether a minimization keeps the linearization of observations from poses before the window, or
/// linearizes them again first.
enum class MarginalPriors { kKeep, kRelinearize };

/// The work of a minimization, and the fit at its end.
struct WindowResult {
  int poses = 0, objects = 0;
  int linearized = 0;        ///< linearized observations of all iterations, also of older poses
  int undefined = 0;         ///< number of observations whose objects are not in front
  double chi_square = 0;     ///< of steps and observations of the window
  int residuals = 0;         ///< number of residuals in that sum
  double cost = 0;           ///< with priors and older observations
  std::vector<int> misfits;  ///< objects whose observations in the window do not fit

  double PenalizedCost() const { return cost + kUndefinedCost * undefined; }
};

/// Minimizes the end of a history, which must outlive the window.
template <typename Pose>
class Window {
 public:
  explicit Window(History<Pose>* history) : history_(*history), model_(history->model) {}

  /// Minimizes all poses from `begin` on by Levenberg-Marquardt.  A known first pose is constant.
  WindowResult Minimize(int begin,
                        MarginalPriors marginal_priors,
                        int iterations,
                        double* damping,
                        EdgeResidual edges = EdgeResidual::kBox);

  /// Minimizes all poses from `begin` on, from their present state and from a new start, and keeps
  /// the result with the lowest cost.  For the new start, odometry gives the poses and boxes give
  /// the young objects.  Tangent residuals are minimized first and box residuals last, as in
  /// Grow(), because box residuals are undefined at most states far from the right one.  In
  /// reinitialize.cc.
  WindowResult Reinitialize(int begin, int iterations);

  /// The first pose of the last minimization.
  int begin() const { return begin_; }

  /// The covariance of the last pose in its tangent, by the last linearization and with all poses
  /// before the window constant.  Returns nothing if the window does not determine it.
  std::optional<typename History<Pose>::Square> CovarianceOfLastPose();

 private:
  static constexpr int k = Pose::kTangentSize;
  using Storage = typename History<Pose>::Storage;

  /// An object that is observed from the window's poses.
  struct Member {
    int object;
    int last_pose;         ///< from which it is observed
    int observations = 0;  ///< number of them in the window
    Vector9d trial = Vector9d::Zero();
  };

  /// An observation from one of the window's poses, and its member.
  struct Seen {
    const Observation* observation;
    int member;
    double depth = 0;  ///< of the tangent residual; 0 for the box residual
  };

  /// The fit of a state.
  struct Fit {
    double cost = 0;                ///< with priors and older observations
    double chi_square = 0;          ///< of the window's steps and observations
    std::vector<double> of_member;  ///< chi-square of the observations of each member
  };

  /// The normal equations, and the factorization of their pattern.  Their blocks are the poses and
  /// then the members, their coupled pairs the steps and then the observations.
  struct System {
    NormalEquations equations;
    BlockCholesky cholesky;
  };

  void Collect(MarginalPriors marginal_priors, WindowResult* result);
  void Couple();
  void Linearize(EdgeResidual edges, WindowResult* result);
  void AddObservation(const Station& station, EdgeResidual edges, size_t row, Accumulator* sum);
  bool MakeTrial(double damping);
  void FitTrial();
  void TakeTrial();

  History<Pose>& history_;
  const Model& model_;
  std::optional<System> system_;
  int begin_ = 0, end_ = 0;
  std::vector<Member> members_;
  std::vector<Seen> seen_;      ///< in the order of their poses
  std::vector<Storage> trial_;  ///< the constant pose before the window, then its poses
  Fit here_, there_;            ///< fits of the history and of the trial
};

}  // namespace dqslam::online
