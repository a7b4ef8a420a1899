// The terms of a stage, as rows of the tables of the graph.  They are fixed while the stage runs.
#pragma once

#include <cstddef>
#include <vector>

#include "dqslam/solver/stage.h"
#include "dqslam/solver/variables.h"

namespace dqslam {

/// The number of boxes that a thread evaluates at a time: about half a millisecond of work.
inline constexpr int kBoxesPerPart = 4096;

/// The residual that a box has in a stage.
struct BoxResidual {
  Residual residual = Residual::kBox;  ///< any but kTangentThenBox
  double depth = 0;                    ///< meters; it scales tangent residuals to pixels
  EdgeFlags one_sided = EdgeFlags::Constant(false);
};

struct StageBox {
  int row;        ///< in the table of boxes
  double weight;  ///< the factor of its loss
  BoxResidual residual;
  Shape shape = Shape::kEllipsoid;  ///< of its object
};

/// Some of a list of terms: from `begin` to before `end`.
struct TermRange {
  size_t begin, end;

  size_t size() const { return end - begin; }
};

struct StageTerms {
  VariableIndex variables;
  std::vector<Shape> shapes;  ///< of all objects; if empty, all are ellipsoids
  std::vector<int> odometry;  ///< rows
  std::vector<StageBox> boxes;
  std::vector<std::vector<int>> measurements;  ///< rows, one list a table

  TermRange all_odometry() const { return {0, odometry.size()}; }
  TermRange all_boxes() const { return {0, boxes.size()}; }
};

/// The terms of a stage, with their poses and objects.  A box whose residual is undefined at
/// `state` gets the tangent residual instead.
StageTerms SelectTerms(const SolveContext& context, const Stage& stage, const State& state);

}  // namespace dqslam
