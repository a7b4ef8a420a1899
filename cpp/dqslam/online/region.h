// The last poses and all objects that they saw, minimised together; older poses are constant.
#pragma once

#include <limits>
#include <vector>

#include "dqslam/online/chain.h"
#include "dqslam/online/past.h"

namespace dqslam::online {

/// What a minimisation did: work and result.
struct Work {
  int poses = 0, objects = 0;
  int front = 0;             ///< objects in the front of the elimination, at most
  int linearized = 0;        ///< sights, over all iterations, of older poses too
  int undefined = 0;         ///< sights whose objects are not in front
  double chi_square = 0;     ///< of steps and sights of the region, at the end
  int residuals = 0;         ///< how many numbers that is the sum of
  double cost = 0;           ///< at the end, priors and older sights included
  std::vector<int> misfits;  ///< objects that their sights in the region do not fit
};

/// A place where a sight is impossible is worth little, however well its tangents fit there.
inline double CostOf(const Work& work) {
  constexpr double kUndefinedCost = 50;
  return work.cost + kUndefinedCost * work.undefined;
}

template <typename Pose>
class Region {
 public:
  explicit Region(const Model& model) : model_(model) {}

  /// How strongly older sights are kept: as they were linearised, or anew.
  enum class Past { kKept, kAnew };

  /// Levenberg-Marquardt on all poses from `begin` on.  A first pose that is known is constant.
  Work Minimize(History<Pose>* history,
                int begin,
                Past past,
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
    const Quadratic* past;
    int sights;  ///< in the region
    Vector9d trial;
  };

  /// How well a state fits.
  struct Fit {
    double cost = 0;                ///< priors and older sights included
    double chi_square = 0;          ///< of the region's steps and sights
    std::vector<double> of_object;  ///< chi-square of the sights of each local object
  };

  /// Where a minimisation comes back to if it finds nothing better.
  struct Checkpoint {
    Fit fit;
    std::vector<Storage> poses;
    std::vector<Vector9d> charts;
  };

  void Collect(History<Pose>* history, int begin, Past past, Work* work);
  bool LinearizeAll(const History<Pose>& history, double damping, Work* work);
  void LinearizePose(const History<Pose>& history, int pose, Work* work);
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
  std::vector<Quadratic> anew_;
  std::vector<int> local_of_object_;  ///< -1 outside of Minimize
  std::vector<Storage> trial_;
  Fit here_, there_;  ///< of the history, and of the trial
  Checkpoint saved_;
  std::vector<double> depth_;  ///< of the tangent residuals of the region's sights, 0 for boxes
  Storage identity_ = Storage::Zero();
};

}  // namespace dqslam::online
