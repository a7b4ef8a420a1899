// The shapes that an object can have.
#pragma once

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

}  // namespace dqslam
