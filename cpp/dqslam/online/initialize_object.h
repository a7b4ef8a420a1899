// Where an object starts, and how it settles while the poses are held fixed.
#pragma once

#include <vector>

#include "dqslam/online/history.h"

namespace dqslam::online {

/// All observations of an object, from poses that are held fixed: least squares in its center and
/// shape.  History and object must outlive it.
template <typename Pose>
class ObjectProblem {
 public:
  ObjectProblem(const History<Pose>& history, const Object& object);

  /// From the first observation: at the depth that the prior size implies, or where it was
  /// measured.
  Vector9d Initialize() const;

  /// From all boxes: the sphere of the prior size, or the one that fits their tangents best.
  Vector9d Reinitialize(bool by_size) const;

  /// Takes a few Levenberg-Marquardt steps; returns the cost.
  double Refine(Vector9d* center_shape);

  /// The place that fits best, refined from where the object is and from both new starts.
  Vector9d ReinitializeIfBetter();

  Matrix9d InformationAt(const Vector9d& center_shape);

 private:
  double Linearize(const Vector9d& center_shape, Matrix9d* H, Vector9d* g);
  double CostAt(const Vector9d& center_shape) const;

  const Model& model_;
  const Object& object_;
  std::vector<const Observation*> observations_;
  std::vector<Station> stations_;  ///< where each was made
  std::vector<double> depths_;     ///< of the residuals linearized last, 0 for those of boxes
};

}  // namespace dqslam::online
