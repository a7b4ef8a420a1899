#include "dqslam/solver/retraction.h"

#include <algorithm>
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
  Step(const StageTerms& terms, const VectorXd& values, const VectorXd& step, VectorXd* moved)
      : variables_(terms.variables),
        shapes_(terms.shapes),
        values_(values),
        step_(step),
        moved_(*moved) {
    moved_ = values;
  }

  void Move(PoseRow pose) {
    Plus<Pose>(Before(pose), TangentOf(pose), After(pose));
    Pose::Normalize(After(pose));
  }
  bool Move(ObjectRow object) {
    if (ShapeOf(shapes_, object.row) != Shape::kEllipsoid) {
      return PlusBody(Before(object), TangentOf(object), After(object));
    }
    return EllipsoidManifold().Plus(Before(object), TangentOf(object), After(object));
  }
  void Move(SharedRow shared) { *After(shared) = *Before(shared) + *TangentOf(shared); }
  void MoveBehind(PoseRow previous, PoseRow pose) {
    PlusBehind<Pose>(Moved(previous), Before(pose), TangentOf(pose), After(pose));
  }
  bool MoveBeside(PoseRow viewer, ObjectRow object) {
    if (ShapeOf(shapes_, object.row) != Shape::kEllipsoid) {
      return PlusBodyBeside<Pose>(Moved(viewer), Before(object), TangentOf(object), After(object));
    }
    return PlusBeside<Pose>(Moved(viewer), Before(object), TangentOf(object), After(object));
  }

 private:
  template <typename Row>
  const double* Before(Row row) const {
    return &values_[variables_.Start(row)];
  }
  template <typename Row>
  double* After(Row row) {
    return &moved_[variables_.Start(row)];
  }
  template <typename Row>
  const double* TangentOf(Row row) const {
    static constexpr double kRest[kTangentOf<Pose, Row>] = {};
    const int start = variables_.Tangent(row);
    return start < 0 ? kRest : &step_[start];
  }
  MovedPose Moved(PoseRow pose) { return {Before(pose), TangentOf(pose), After(pose)}; }

  const VariableIndex& variables_;
  const std::vector<Shape>& shapes_;
  const VectorXd& values_;
  const VectorXd& step_;
  VectorXd& moved_;
};

// The row of the last pose that observes each object; without a box, the first pose of the stage.
std::vector<int> Viewers(const Graph& graph, const StageTerms& terms) {
  std::vector<int> viewers(graph.num_objects(), terms.variables.first_pose);
  for (const StageBox& box : terms.boxes) {
    viewers[graph.boxes.object[box.row]] = graph.boxes.pose[box.row];
  }
  return viewers;
}

}  // namespace

template <typename Pose>
bool Retract(const StageTerms& terms,
             const VectorXd& values,
             const VectorXd& step,
             VectorXd* moved) {
  const VariableIndex& variables = terms.variables;
  Step<Pose> steps(terms, values, step, moved);
  for (int pose = variables.first_free_pose; pose < variables.end_pose; ++pose) {
    steps.Move(PoseRow{pose});
  }
  for (int row = 0; row < variables.num_shared; ++row) steps.Move(SharedRow{row});
  return std::all_of(variables.objects.begin(), variables.objects.end(), [&](int object) {
    return steps.Move(ObjectRow{object});
  });
}

template <typename Pose>
bool RetractAlongPath(const PreparedGraph& prepared,
                      const StageTerms& terms,
                      const VectorXd& values,
                      const VectorXd& step,
                      VectorXd* moved) {
  const VariableIndex& variables = terms.variables;
  Step<Pose> steps(terms, values, step, moved);
  for (int pose = variables.first_free_pose; pose < variables.end_pose; ++pose) {
    const int row = prepared.odometry_into[pose];
    if (row < 0) {
      steps.Move(PoseRow{pose});
    } else {
      steps.MoveBehind(PoseRow{prepared.graph.odometry.from[row]}, PoseRow{pose});
    }
  }
  for (int row = 0; row < variables.num_shared; ++row) steps.Move(SharedRow{row});
  const std::vector<int> viewers = Viewers(prepared.graph, terms);
  return std::all_of(variables.objects.begin(), variables.objects.end(), [&](int object) {
    return steps.MoveBeside(PoseRow{viewers[object]}, ObjectRow{object});
  });
}

#define DQSLAM_INSTANTIATE(Pose)                                                               \
  template bool Retract<Pose>(const StageTerms&, const VectorXd&, const VectorXd&, VectorXd*); \
  template bool RetractAlongPath<Pose>(                                                        \
      const PreparedGraph&, const StageTerms&, const VectorXd&, const VectorXd&, VectorXd*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam
