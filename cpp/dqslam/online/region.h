// The last poses and all objects that they saw, minimised together; older poses are constant.
#pragma once

#include <limits>
#include <vector>

#include "dqslam/online/chain.h"
#include "dqslam/online/linearize.h"

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
  bool moved = false;        ///< whether an iteration was accepted
  std::vector<int> misfits;  ///< objects that their sights in the region do not fit
};

/// Information about an object from its sights before a pose, poses held fixed: rows
/// [first, last) of object.sights, linearised where all stand now.
template <typename Pose>
void AddPast(const Model& model,
             const History<Pose>& history,
             const Object& object,
             int first,
             int last,
             Quadratic* past);

/// How many sights of an object are from poses before `pose`; it has `known` at least.
template <typename Pose>
int CountPast(const History<Pose>& history, const Object& object, int pose, int known);

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
    Vector9d trial;
    double chi_square = 0;  ///< of its sights in the region, at the trial
    int sights = 0;
  };

  void Collect(History<Pose>* history, int begin, Past past, Work* work);
  double LinearizeAll(const History<Pose>& history, double damping, bool* solved, Work* work);
  double LinearizePose(const History<Pose>& history, int pose, Work* work);
  bool Leave(int pose);
  bool MakeTrial(const History<Pose>& history);
  double TrialCost(const History<Pose>& history, Work* work);
  const double* TrialPose(const History<Pose>& history, int pose) const;

  const Model& model_;
  Chain<k> chain_;
  Edges edges_ = Edges::kBox;
  int begin_ = 0, end_ = 0;
  std::vector<Local> locals_;
  std::vector<Quadratic> anew_;
  std::vector<int> local_of_object_;  ///< -1 outside of Minimize
  std::vector<Storage> trial_;
  std::vector<double> depth_;  ///< of the tangent residuals of the region's sights, 0 for boxes
  Storage identity_ = Storage::Zero();
};

}  // namespace dqslam::online
