// Initialization and refinement of an object while the poses are constant.
#pragma once

#include <vector>

#include "dqslam/online/history.h"

namespace dqslam::online {

/// The least-squares problem of an object's center and shape, with all its observations and
/// constant poses.  History and object must outlive it.
template <typename Pose>
class ObjectProblem {
 public:
  ObjectProblem(const History<Pose>& history, const Object& object);

  /// Starts the object from its first observation: at the depth that the prior size implies, or at
  /// the measured place.
  Vector9d Initialize() const;

  /// Starts the object from all boxes: a sphere of the prior size, or the sphere that fits their
  /// tangents best.
  Vector9d Reinitialize(bool by_size) const;

  /// Takes a few Levenberg-Marquardt steps and returns the cost.
  double Refine(Vector9d* center_shape);

  /// Refines the object from its present state and from both new starts, and returns the best
  /// result.
  Vector9d ReinitializeIfBetter();

  Matrix9d InformationAt(const Vector9d& center_shape);

 private:
  double Linearize(const Vector9d& center_shape, Matrix9d* H, Vector9d* g);
  double CostAt(const Vector9d& center_shape) const;

  const Model& model_;
  const Object& object_;
  std::vector<const Observation*> observations_;
  std::vector<Station> stations_;  ///< station of each observation
  std::vector<double> depths_;     ///< of the residuals linearized last; 0 for box residuals
};

}  // namespace dqslam::online
