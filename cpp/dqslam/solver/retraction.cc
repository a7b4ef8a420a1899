#include "dqslam/solver/retraction.h"

#include <vector>

#include "dqslam/geometry/manifolds.h"
#include "dqslam/solver/path_step.h"

namespace dqslam {
namespace {

using Eigen::VectorXd;

template <typename Pose, typename Landmark>
class StageStep {
 public:
  StageStep(const PackedStage<Pose>& stage,
            const VectorXd& values,
            const VectorXd& step,
            VectorXd* moved)
      : stage_(stage), slots_(stage.slots), values_(values), step_(step), moved_(*moved) {
    moved_ = values;
    moved_.tail(slots_.num_switches) += step.tail(slots_.num_switches);
  }

  bool Straight() {
    for (int pose = slots_.first_free_pose; pose < slots_.end_pose; ++pose) MovePose(pose);
    for (int slot = 0; slot < slots_.num_objects(); ++slot) {
      const double* tangent = &step_[stage_.TangentOfObject(slot)];
      const int start = stage_.ObjectStart(slot);
      if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
        if (!EllipsoidManifold().Plus(&values_[start], tangent, &moved_[start])) return false;
      } else {
        moved_.template segment<kLandmarkSize>(start) += Eigen::Map<const Vector9d>(tangent);
      }
    }
    return true;
  }

  bool AlongPath() {
    if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
      for (int pose = slots_.first_free_pose; pose < slots_.end_pose; ++pose) {
        const int row = stage_.prepared.odometry_into[pose];
        if (row < 0) {
          MovePose(pose);
          continue;
        }
        PlusBehind<Pose>(Moved(stage_.prepared.graph.odometry.from[row]),
                         &values_[stage_.PoseStart(pose)],
                         TangentOf(pose),
                         &moved_[stage_.PoseStart(pose)]);
      }
      const std::vector<int> viewers = Viewers();
      for (int slot = 0; slot < slots_.num_objects(); ++slot) {
        const int start = stage_.ObjectStart(slot);
        if (!PlusBeside<Pose>(Moved(viewers[slot]),
                              &values_[start],
                              &step_[stage_.TangentOfObject(slot)],
                              &moved_[start])) {
          return false;
        }
      }
      return true;
    }
    return false;
  }

 private:
  const double* TangentOf(int pose) const {
    static constexpr double kRest[Pose::kTangentSize] = {};
    return pose < slots_.first_free_pose ? kRest : &step_[stage_.TangentOfPose(pose)];
  }

  void MovePose(int pose) {
    const int start = stage_.PoseStart(pose);
    Plus<Pose>(&values_[start], TangentOf(pose), &moved_[start]);
    Pose::Normalize(&moved_[start]);
  }

  MovedPose Moved(int pose) const {
    const int start = stage_.PoseStart(pose);
    return {&values_[start], TangentOf(pose), &moved_[start]};
  }

  // The last pose to see each object; the first of all where no box has a weight.
  std::vector<int> Viewers() const {
    const BoxTable& boxes = stage_.prepared.graph.boxes;
    std::vector<int> viewers(slots_.num_objects(), slots_.first_pose);
    for (const BoxLink& link : stage_.links.boxes) {
      viewers[slots_.slot_of_object[boxes.object[link.row]]] = boxes.pose[link.row];
    }
    return viewers;
  }

  const PackedStage<Pose>& stage_;
  const VariableIndex& slots_;
  const VectorXd& values_;
  const VectorXd& step_;
  VectorXd& moved_;
};

}  // namespace

template <typename Pose, typename Landmark>
bool Retract(const PackedStage<Pose>& stage,
             const VectorXd& values,
             const VectorXd& step,
             VectorXd* moved) {
  return StageStep<Pose, Landmark>(stage, values, step, moved).Straight();
}

template <typename Pose, typename Landmark>
bool RetractAlongPath(const PackedStage<Pose>& stage,
                      const VectorXd& values,
                      const VectorXd& step,
                      VectorXd* moved) {
  return StageStep<Pose, Landmark>(stage, values, step, moved).AlongPath();
}

template bool Retract<Se2, EllipsoidModel>(const PackedStage<Se2>&,
                                           const VectorXd&,
                                           const VectorXd&,
                                           VectorXd*);
template bool RetractAlongPath<Se2, EllipsoidModel>(const PackedStage<Se2>&,
                                                    const VectorXd&,
                                                    const VectorXd&,
                                                    VectorXd*);
template bool Retract<Se2, DualQuadricModel>(const PackedStage<Se2>&,
                                             const VectorXd&,
                                             const VectorXd&,
                                             VectorXd*);
template bool RetractAlongPath<Se2, DualQuadricModel>(const PackedStage<Se2>&,
                                                      const VectorXd&,
                                                      const VectorXd&,
                                                      VectorXd*);
template bool Retract<Se3, EllipsoidModel>(const PackedStage<Se3>&,
                                           const VectorXd&,
                                           const VectorXd&,
                                           VectorXd*);
template bool RetractAlongPath<Se3, EllipsoidModel>(const PackedStage<Se3>&,
                                                    const VectorXd&,
                                                    const VectorXd&,
                                                    VectorXd*);
template bool Retract<Se3, DualQuadricModel>(const PackedStage<Se3>&,
                                             const VectorXd&,
                                             const VectorXd&,
                                             VectorXd*);
template bool RetractAlongPath<Se3, DualQuadricModel>(const PackedStage<Se3>&,
                                                      const VectorXd&,
                                                      const VectorXd&,
                                                      VectorXd*);

}  // namespace dqslam
