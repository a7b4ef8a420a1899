#include "dqslam/solver/retraction.h"

#include <vector>

#include "dqslam/geometry/manifolds.h"
#include "dqslam/solver/path_step.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

// The values of a stage before and after a step.
template <typename Pose>
class Step {
 public:
  Step(const VariableIndex& variables,
       const VectorXd& values,
       const VectorXd& step,
       VectorXd* moved)
      : variables_(variables), values_(values), step_(step), moved_(*moved) {
    moved_ = values;
  }

  void MovePose(int pose) {
    double* result = Reached(pose);
    Plus<Pose>(&values_[variables_.PoseStart(pose)], TangentOf(pose), result);
    Pose::Normalize(result);
  }

  bool MoveObject(int slot) {
    const int start = variables_.ObjectStart(slot);
    return EllipsoidManifold().Plus(&values_[start], TangentOfObject(slot), &moved_[start]);
  }

  void MovePoseBehind(int previous, int pose) {
    PlusBehind<Pose>(
        Moved(previous), &values_[variables_.PoseStart(pose)], TangentOf(pose), Reached(pose));
  }

  bool MoveObjectBeside(int viewer, int slot) {
    const int start = variables_.ObjectStart(slot);
    return PlusBeside<Pose>(Moved(viewer), &values_[start], TangentOfObject(slot), &moved_[start]);
  }

 private:
  double* Reached(int pose) { return &moved_[variables_.PoseStart(pose)]; }
  const double* TangentOfObject(int slot) const { return &step_[variables_.TangentOfObject(slot)]; }
  const double* TangentOf(int pose) const {
    static constexpr double kRest[Pose::kTangentSize] = {};
    return pose < variables_.first_free_pose ? kRest : &step_[variables_.TangentOfPose(pose)];
  }
  MovedPose Moved(int pose) const {
    const int start = variables_.PoseStart(pose);
    return {&values_[start], TangentOf(pose), &moved_[start]};
  }

  const VariableIndex& variables_;
  const VectorXd& values_;
  const VectorXd& step_;
  VectorXd& moved_;
};

// The last pose to see each object; the first of all where no box has a weight.
std::vector<int> Viewers(const BoxTable& boxes, const StageTerms& terms) {
  const VariableIndex& variables = terms.variables;
  std::vector<int> viewers(variables.num_objects(), variables.first_pose);
  for (const StageBox& box : terms.boxes) {
    viewers[variables.slot_of_object[boxes.object[box.row]]] = boxes.pose[box.row];
  }
  return viewers;
}

}  // namespace

template <typename Pose>
bool Retract(const VariableIndex& variables,
             const VectorXd& values,
             const VectorXd& step,
             VectorXd* moved) {
  Step<Pose> steps(variables, values, step, moved);
  for (int pose = variables.first_free_pose; pose < variables.end_pose; ++pose) {
    steps.MovePose(pose);
  }
  for (int slot = 0; slot < variables.num_objects(); ++slot) {
    if (!steps.MoveObject(slot)) return false;
  }
  return true;
}

template <typename Pose>
bool RetractAlongPath(const PreparedGraph& prepared,
                      const StageTerms& terms,
                      const VectorXd& values,
                      const VectorXd& step,
                      VectorXd* moved) {
  const VariableIndex& variables = terms.variables;
  Step<Pose> steps(variables, values, step, moved);
  for (int pose = variables.first_free_pose; pose < variables.end_pose; ++pose) {
    const int row = prepared.odometry_into[pose];
    if (row < 0) {
      steps.MovePose(pose);
    } else {
      steps.MovePoseBehind(prepared.graph.odometry.from[row], pose);
    }
  }
  const std::vector<int> viewers = Viewers(prepared.graph.boxes, terms);
  for (int slot = 0; slot < variables.num_objects(); ++slot) {
    if (!steps.MoveObjectBeside(viewers[slot], slot)) return false;
  }
  return true;
}

#define DQSLAM_INSTANTIATE(Pose)                                                                  \
  template bool Retract<Pose>(const VariableIndex&, const VectorXd&, const VectorXd&, VectorXd*); \
  template bool RetractAlongPath<Pose>(                                                           \
      const PreparedGraph&, const StageTerms&, const VectorXd&, const VectorXd&, VectorXd*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam
