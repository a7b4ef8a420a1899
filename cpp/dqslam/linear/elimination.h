// The layout of a block matrix that is factorized front by front.
#pragma once

#include <cstddef>
#include <vector>

#include "dqslam/linear/block_pattern.h"
#include "dqslam/linear/subtrees.h"

namespace dqslam {

/// Columns of the factor that have the same rows and are eliminated together. The columns subtract
/// a matrix from the rows below their pivots: the front's update, which waits on a stack until the
/// parent adds it.
struct Front {
  int pivot;   ///< the first pivot, as a row in the order of elimination
  int pivots;  ///< the number of pivots
  int below;   ///< the number of rows below the pivots
  /// The first of its rows, blocks and children in the lists of Elimination. They end where those
  /// of the next front begin.
  int row, block, child;
  /// The stack of its update: 2 s or 2 s + 1 for a front of subtree s - 1, and 0 or 1 for a front
  /// of no subtree.  The updates of its children are on the other of the two, or on that of a
  /// subtree.
  int stack;
  std::ptrdiff_t update;  ///< start on that stack: below x below, column-major, lower triangle
  std::ptrdiff_t factor;  ///< start in the factor: rows() x pivots, column-major

  int rows() const { return pivots + below; }
};

/// Where a block of A goes among the columns of a front.
struct PlacedBlock {
  int index;  ///< as in BlockPattern::coupled, or -1 - b for block b on the diagonal
  int row, column;
  bool transposed;
};

/// `length` rows of a child's update, starting at `from`, are the rows of its parent's front that
/// start at `to`.
struct RowRun {
  int from, to, length;
};

struct Child {
  int front;
  int run;  ///< the first of its runs in Elimination; they end where those of the next child begin
};

/// The symbolic half of a multifrontal factorization (Duff & Reid 1983). It depends only on the
/// pattern.
struct Elimination {
  explicit Elimination(const BlockPattern& A);

  int num_fronts() const { return static_cast<int>(fronts.size()) - 1; }

  std::vector<int> place;     ///< the place of each row of A in the order of elimination
  std::vector<Front> fronts;  ///< children before parents; the last entry only marks the end
  std::vector<int> rows;      ///< rows below the pivots, in the order of elimination, ascending
  std::vector<PlacedBlock> blocks;
  std::vector<Child> children;  ///< ascending; the last entry only marks the end
  std::vector<RowRun> runs;
  std::vector<Subtree> subtrees;  ///< these share neither stacks nor columns
  std::vector<std::ptrdiff_t> stack_size;
};

}  // namespace dqslam
