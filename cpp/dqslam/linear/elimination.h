// Where everything goes when a block matrix is factorized front by front.
#pragma once

#include <cstddef>
#include <vector>

#include "dqslam/linear/block_matrix.h"

namespace dqslam {

/// Columns of the factor that share their rows and are eliminated together. What they subtract
/// from the rows below their pivots, the front's update, waits on a stack for the parent.
struct Front {
  int pivot;          ///< the first one, in the order of elimination
  int pivots, below;  ///< numbers of pivots and of rows below them
  int row, block,
      child;  ///< where its own begin in Elimination; where the next front's do they end
  int stack;  ///< 0 or 1: of its update; those of its children are on the other one
  std::ptrdiff_t update;  ///< start on that stack: below x below, column-major, lower triangle
  std::ptrdiff_t factor;  ///< start in the factor: rows() x pivots, column-major

  int rows() const { return pivots + below; }
};

/// Where a block of A goes among the columns of a front.
struct PlacedBlock {
  int index;  ///< as in BlockMatrix::OffDiagonal; of block b on the diagonal: -1 - b
  int row, column;
  bool transposed;
};

/// Rows from `from` on of a child's update are rows from `to` on of its parent's front.
struct RowRun {
  int from, to, length;
};

struct Child {
  int front;
  int run;  ///< where its runs begin in Elimination; where the next child's do they end
};

/// The symbolic half of a multifrontal factorization (Duff & Reid 1983), from the pattern alone.
struct Elimination {
  explicit Elimination(const BlockMatrix& A);

  int num_fronts() const { return static_cast<int>(fronts.size()) - 1; }

  std::vector<int> place;     ///< of each row of A in the order of elimination
  std::vector<Front> fronts;  ///< children before parents; the last one only ends the one before
  std::vector<int> rows;      ///< below the pivots, in the order of elimination, ascending
  std::vector<PlacedBlock> blocks;
  std::vector<Child> children;  ///< ascending; the last one only ends the one before
  std::vector<RowRun> runs;
  std::ptrdiff_t stack_size[2] = {0, 0};
};

}  // namespace dqslam
