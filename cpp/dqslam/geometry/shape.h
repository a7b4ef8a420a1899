// The shapes that an object can have.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace dqslam {

enum class Shape {
  kEllipsoid,
  kCuboid,
  kCylinder,
  kAuto,  ///< of a graph only: the shape that explains the boxes best
};

/// The shape of an object, from a list that is empty where all objects are ellipsoids.
inline Shape ShapeOf(const std::vector<Shape>& shapes, int object) {
  return shapes.empty() ? Shape::kEllipsoid : shapes[static_cast<std::size_t>(object)];
}

/// Whether no object has, or may get, another shape than an ellipsoid.
inline bool AreEllipsoids(const std::vector<Shape>& shapes) {
  return std::all_of(
      shapes.begin(), shapes.end(), [](Shape shape) { return shape == Shape::kEllipsoid; });
}

}  // namespace dqslam
