// What takes part in a stage: rows of the tables of the graph, fixed while the stage runs.
#pragma once

#include <vector>

#include "dqslam/solver/stage.h"
#include "dqslam/solver/variables.h"

namespace dqslam {

/// Which residual a box has in a stage.
struct BoxResidual {
  Residual residual = Residual::kBox;  ///< not kTangentThenBox
  double depth = 0;                    ///< at which tangents turn into pixels, meters; 0: not used
  EdgeFlags one_sided = EdgeFlags::Constant(false);
};

struct StageBox {
  int row;        ///< in the table of boxes
  double weight;  ///< of its loss
  BoxResidual residual;
};

struct StageTerms {
  VariableIndex variables;
  std::vector<int> odometry;  ///< rows
  std::vector<StageBox> boxes;
  std::vector<std::vector<int>> measurements;  ///< rows, one list a table
};

/// Terms of the stage, and the poses and objects that they are about.  A box whose own residual is
/// undefined at `state` gets the tangent residual.
StageTerms SelectTerms(const PreparedGraph& prepared,
                       const SolveOptions& options,
                       const Stage& stage,
                       const State& state);

}  // namespace dqslam
