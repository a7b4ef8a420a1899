// The last poses and all objects that they saw, minimized together; older poses are constant.
#pragma once

#include <vector>

#include "dqslam/linear/chain_elimination.h"
#include "dqslam/online/linearize.h"
#include "dqslam/online/options.h"

namespace dqslam::online {

/// What a chain of poses does as a whole weighs little beside the diagonal of its normal equations:
/// with more damping than this a long one only creeps.
inline constexpr double kFirstDamping = 1e-8;

/// What is done with the observations from poses before the window: they stay as they were
/// linearized, or are linearized anew, before a minimization that moves their objects for good.
enum class MarginalPriors { kKeep, kRelinearize };

/// What a minimization did, and how well all fits at its end.
struct WindowResult {
  int poses = 0, objects = 0;
  int front = 0;             ///< objects in the front of the elimination, at most
  int linearized = 0;        ///< observations, over all iterations, of older poses too
  int undefined = 0;         ///< observations whose objects are not in front
  double chi_square = 0;     ///< of steps and observations of the window
  int residuals = 0;         ///< how many numbers that is the sum of
  double cost = 0;           ///< priors and older observations included
  std::vector<int> misfits;  ///< objects that their observations in the window do not fit

  double PenalizedCost() const { return cost + kUndefinedCost * undefined; }
};

/// Minimizes the end of a history, which must outlive it.
template <typename Pose>
class Window {
 public:
  explicit Window(History<Pose>* history) : history_(*history), model_(history->model) {}

  /// Levenberg-Marquardt on all poses from `begin` on.  A first pose that is known is constant.
  WindowResult Minimize(int begin,
                        MarginalPriors marginal_priors,
                        int iterations,
                        double* damping,
                        EdgeResidual edges = EdgeResidual::kBox);

  /// Boxes reject most places far from the right one.  Minimizes all poses from `begin` on from
  /// where they are, and from new starts: odometry puts the poses, and their boxes the young
  /// objects, and the tangent residual leads from there to what the boxes then refine, as in
  /// Grow().  Keeps what costs least.  In reinitialize.cc.
  WindowResult Reinitialize(int begin, int iterations);

  /// Minimizes all poses from `begin` on.  Boxes say little of an object that is far beside them.
  /// Where one does not fit then, the poses from `window_begin` on, which have been bent towards
  /// what came back, go back to their odometry, the objects to where they were before, and what the
  /// boxes since then say of them is at first a point each: positions lead from far to what the
  /// boxes then refine.  Keeps what costs least.  In loop_closing.cc.
  WindowResult CloseLoop(int begin, int window_begin, const OnlineOptions& options);

 private:
  static constexpr int k = Pose::kTangentSize;
  using Storage = typename History<Pose>::Storage;

  /// An object that the window's poses see.
  struct Member {
    int object;
    int last_pose;         ///< that sees it
    int slot = -1;         ///< in the chain, from its first observation on
    int observations = 0;  ///< in the window
    Vector9d trial = Vector9d::Zero();
  };

  /// An observation from one of the window's poses, of the object of a member.
  struct Seen {
    const Observation* observation;
    int member;
    double depth = 0;  ///< of the tangent residual, 0 where it is the box's
  };

  /// How well a state fits.
  struct Fit {
    double cost = 0;                ///< priors and older observations included
    double chi_square = 0;          ///< of the window's steps and observations
    std::vector<double> of_member;  ///< chi-square of its observations
  };

  void Collect(MarginalPriors marginal_priors, WindowResult* result);
  bool Linearize(double damping, EdgeResidual edges, WindowResult* result);
  void Linearize(const Station& station, EdgeResidual edges, Seen* seen, WindowResult* result);
  bool EliminateObjectsOf(int pose);
  bool MakeTrial();
  void FitTrial();
  void TakeTrial();

  History<Pose>& history_;
  const Model& model_;
  ChainElimination<k> chain_;
  int begin_ = 0, end_ = 0;
  std::vector<Member> members_;
  std::vector<Seen> seen_;      ///< in the order of their poses
  std::vector<Storage> trial_;  ///< the constant pose before the window, then its poses
  Fit here_, there_;            ///< of the history, and of the trial
};

}  // namespace dqslam::online
