// In which order the blocks of a matrix are eliminated, and in which dense pieces.
#pragma once

#include <cstddef>
#include <vector>

#include "dqslam/block_matrix.h"

namespace dqslam {

/// Columns of the factor that share their rows and are eliminated together: a dense matrix whose
/// first rows are the pivots. What it subtracts from the rows below them, its update, waits on one
/// of two stacks for the parent: the first front that has one of these rows for a pivot.
struct Front {
  int column;             ///< first pivot, in the order of elimination
  int columns;            ///< number of pivots
  int below;              ///< number of rows below them
  int row, block, child;  ///< where its own begin in Elimination; at the next front's they end
  int stack;              ///< 0 or 1: of its update. Its children's are on the other one.
  std::ptrdiff_t update;  ///< start on the stack, below x below, column-major, lower triangle
  std::ptrdiff_t factor;  ///< start in the factor, (columns + below) x columns, column-major
};

/// Where a block of A goes within the columns of a front.
struct PlacedBlock {
  int index;  ///< as in BlockMatrix::OffDiagonal; block b on the diagonal is -1 - b
  int row, column;
  bool transposed;
};

/// Rows `from` and on of a child's update are rows `to` and on of its parent's front.
struct Run {
  int from, to, length;
};

struct Child {
  int front;
  int run;  ///< where its runs begin in Elimination; at the next child's they end
};

/// The symbolic half of a multifrontal factorisation (Duff & Reid 1983): all that follows from the
/// pattern of the matrix.
struct Elimination {
  explicit Elimination(const BlockMatrix& A);

  std::vector<int> place;  ///< of a row of A in the order of elimination
  std::vector<Front>
      fronts;             ///< children before parents; the last one is empty and ends the others
  std::vector<int> rows;  ///< below the pivots, in the order of elimination, ascending
  std::vector<PlacedBlock> blocks;
  std::vector<Child> children;  ///< the last one ends the others
  std::vector<Run> runs;
  std::ptrdiff_t stack_size[2] = {0, 0};
};

}  // namespace dqslam
