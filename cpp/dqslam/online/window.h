// The last poses and all objects that they saw, minimized together; older poses are constant.
#pragma once

#include <limits>
#include <vector>

#include "dqslam/linear/chain_elimination.h"
#include "dqslam/online/marginal_prior.h"

namespace dqslam::online {

/// What a minimization did: result and result.
struct WindowResult {
  int poses = 0, objects = 0;
  int front = 0;             ///< objects in the front of the elimination, at most
  int linearized = 0;        ///< observations, over all iterations, of older poses too
  int undefined = 0;         ///< observations whose objects are not in front
  double chi_square = 0;     ///< of steps and observations of the window, at the end
  int residuals = 0;         ///< how many numbers that is the sum of
  double cost = 0;           ///< at the end, priors and older observations included
  std::vector<int> misfits;  ///< objects that their observations in the window do not fit
};

/// A place where a observation is impossible is worth little, however well its tangents fit there.
inline double CostOf(const WindowResult& result) {
  constexpr double kUndefinedCost = 50;
  return result.cost + kUndefinedCost * result.undefined;
}

template <typename Pose>
class Window {
 public:
  explicit Window(const Model& model) : model_(model) {}

  /// How strongly older observations are kept: as they were linearized, or anew.
  enum class MarginalPriors { kKeep, kRelinearize };

  /// Levenberg-Marquardt on all poses from `begin` on.  A first pose that is known is constant.
  WindowResult Minimize(History<Pose>* history,
                        int begin,
                        MarginalPriors marginal_priors,
                        int iterations,
                        double* damping,
                        Edges edges = Edges::kBox);

 private:
  static constexpr int k = Pose::kTangentSize;
  using Storage = typename History<Pose>::Storage;

  struct Local {
    int object;
    int last_pose;  ///< that sees it
    int slot;
    const GaussianPrior* marginal;
    int observations;  ///< in the window
    Vector9d trial;
  };

  /// How well a state fits.
  struct Fit {
    double cost = 0;                ///< priors and older observations included
    double chi_square = 0;          ///< of the window's steps and observations
    std::vector<double> of_object;  ///< chi-square of the observations of each local object
  };

  /// Where a minimization comes back to if it finds nothing better.
  struct Checkpoint {
    Fit fit;
    std::vector<Storage> poses;
    std::vector<Vector9d> center_shapes;
  };

  void Collect(History<Pose>* history,
               int begin,
               MarginalPriors marginal_priors,
               WindowResult* result);
  bool LinearizeAll(const History<Pose>& history, double damping, WindowResult* result);
  void LinearizePose(const History<Pose>& history, int pose, WindowResult* result);
  bool Leave(int pose);
  bool MakeTrial(const History<Pose>& history);
  void FitTrial(const History<Pose>& history);
  void TakeTrial(History<Pose>* history);
  void Save(const History<Pose>& history);
  void Restore(History<Pose>* history);
  const double* TrialPose(const History<Pose>& history, int pose) const;

  const Model& model_;
  Chain<k> chain_;
  Edges edges_ = Edges::kBox;
  int begin_ = 0, end_ = 0;
  std::vector<Local> locals_;
  std::vector<GaussianPrior> relinearized_;
  std::vector<int> local_of_object_;  ///< -1 outside of Minimize
  std::vector<Storage> trial_;
  Fit here_, there_;  ///< of the history, and of the trial
  Checkpoint saved_;
  std::vector<double>
      depth_;  ///< of the tangent residuals of the window's observations, 0 for boxes
  Storage identity_ = Storage::Zero();
};

}  // namespace dqslam::online
