// Bodies fitted to the boxes of one object, while all poses and other objects stay.
#pragma once

#include <array>
#include <limits>
#include <vector>

#include "dqslam/geometry/body.h"
#include "dqslam/solver/stage.h"

namespace dqslam {

/// A shape that an object may have, and where.
struct ShapeCandidate {
  Shape shape = Shape::kEllipsoid;
  Vector9d parameters = Vector9d::Zero();
  double cost = std::numeric_limits<double>::infinity();  ///< of the object's boxes and priors
};

/// Looks for the shapes of the objects of a state.
class ShapeFitter {
 public:
  /// `state` has a shape for each object, and at first the ellipsoids that fit their boxes.  It
  /// must outlive the fitter.
  ShapeFitter(const SolveContext& context, const Stage& all, State* state);

  /// Counts the shapes of the objects among which a shape is chosen: a shape that many have is
  /// likely for the others.
  void CountShapes(const std::vector<Shape>& wanted);

  /// Changes an object to the best candidate, if that is better than what it is.
  bool Improve(int object, const std::vector<Shape>& shapes);

  /// Other minima of a body by itself, lowest first.  They may be better than the one where it is
  /// if all poses and bodies move, too.
  std::vector<ShapeCandidate> Alternatives(int object);

  /// Starts of a body that has bent the path, so that its boxes by themselves do not lead back.
  std::vector<ShapeCandidate> FreshStarts(int object) const;

  /// Changes the shape of an object.
  void Set(int object, const ShapeCandidate& candidate);

 private:
  double HandicapOf(Shape shape) const { return handicap_[static_cast<int>(shape)]; }
  ShapeCandidate Now(int object) const;
  ShapeCandidate Minimized(int object, ShapeCandidate candidate);
  std::vector<ShapeCandidate> Starts(int object, Shape shape) const;
  ShapeCandidate Upright(int object, Shape shape, double yaw) const;
  void AddTurned(int object, std::vector<ShapeCandidate>* starts) const;
  double CostOf(int object, Shape shape, const Vector9d& parameters) const;

  const SolveContext& context_;
  Stage all_;
  State& state_;
  RowMatrix ellipsoids_;            // that fit the same boxes
  std::array<double, 3> handicap_;  // of each shape
};

}  // namespace dqslam
