#include "dqslam/block_cholesky.h"

#include <algorithm>

#include "dqslam/dense_front.h"

namespace dqslam {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// target += the lower triangle of a child's update; `ld` is the number of rows of the front, whose
// columns from `columns` on are in `update` instead of `factor`.
void AddUpdate(const double* source,
               int size,
               const Run* begin,
               const Run* end,
               int columns,
               int below,
               double* factor,
               double* update) {
  for (const Run* run = begin; run != end; ++run) {
    for (int c = 0; c < run->length; ++c) {
      const int column = run->to + c;
      const double* from = source + std::ptrdiff_t{run->from + c} * size;
      double* to = column < columns ? factor + std::ptrdiff_t{column} * (columns + below)
                                    : update + std::ptrdiff_t{column - columns} * below - columns;
      for (int r = c; r < run->length; ++r) to[run->to + r] += from[run->from + r];
      for (const Run* rest = run + 1; rest != end; ++rest) {
        for (int r = 0; r < rest->length; ++r) to[rest->to + r] += from[rest->from + r];
      }
    }
  }
}

}  // namespace

BlockCholesky::BlockCholesky(const BlockMatrix& A) : elimination_(A) {
  factor_.resize(elimination_.fronts.back().factor + kFrontPadding);
  for (int s = 0; s < 2; ++s) stacks_[s].resize(elimination_.stack_size[s]);
}

void BlockCholesky::Assemble(const BlockMatrix& A, const Front& front, const Front& end) {
  const int rows = front.columns + front.below;
  double* factor = factor_.data() + front.factor;
  double* update = stacks_[front.stack].data() + front.update;
  std::fill_n(factor, std::ptrdiff_t{rows} * front.columns, 0.0);
  for (int c = 0; c < front.below; ++c) {
    std::fill_n(update + std::ptrdiff_t{c} * (front.below + 1), front.below - c, 0.0);
  }
  for (int k = front.block; k < end.block; ++k) {
    const PlacedBlock& placed = elimination_.blocks[k];
    double* to = factor + std::ptrdiff_t{placed.column} * rows + placed.row;
    if (placed.index < 0) {
      const int size = A.size(-1 - placed.index);
      const double* from = A.Diagonal(-1 - placed.index);
      for (int c = 0; c < size; ++c) {
        for (int r = c; r < size; ++r) to[c * rows + r] = from[c * size + r];
      }
    } else {
      const auto [i, j] = A.coupled(placed.index);
      const int rows_from = A.size(i), columns_from = A.size(j);
      const double* from = A.OffDiagonal(placed.index);
      for (int c = 0; c < columns_from; ++c) {
        for (int r = 0; r < rows_from; ++r) {
          (placed.transposed ? to[r * rows + c] : to[c * rows + r]) = from[c * rows_from + r];
        }
      }
    }
  }
  for (int k = front.child; k < end.child; ++k) {
    const Child& child = elimination_.children[k];
    const Front& from = elimination_.fronts[child.front];
    AddUpdate(stacks_[from.stack].data() + from.update,
              from.below,
              elimination_.runs.data() + child.run,
              elimination_.runs.data() + elimination_.children[k + 1].run,
              front.columns,
              front.below,
              factor,
              update);
  }
}

bool BlockCholesky::Factorize(const BlockMatrix& A, const VectorXd& damping) {
  VectorXd placed(damping.size());
  for (Eigen::Index r = 0; r < damping.size(); ++r) placed[elimination_.place[r]] = damping[r];
  for (size_t f = 0; f + 1 < elimination_.fronts.size(); ++f) {
    const Front& front = elimination_.fronts[f];
    Assemble(A, front, elimination_.fronts[f + 1]);
    double* factor = factor_.data() + front.factor;
    const int rows = front.columns + front.below;
    for (int c = 0; c < front.columns; ++c) {
      factor[std::ptrdiff_t{c} * (rows + 1)] += placed[front.column + c];
    }
    if (!EliminatePivots(front.columns, rows, factor, stacks_[front.stack].data() + front.update)) {
      return false;
    }
  }
  return true;
}

VectorXd BlockCholesky::Solve(const VectorXd& b) const {
  const Elimination& e = elimination_;
  VectorXd x(b.size()), below;
  for (Eigen::Index r = 0; r < b.size(); ++r) x[e.place[r]] = b[r];
  const int fronts = static_cast<int>(e.fronts.size()) - 1;
  for (int f = 0; f < fronts; ++f) {
    const Front& front = e.fronts[f];
    const Eigen::Map<const MatrixXd> L(
        factor_.data() + front.factor, front.columns + front.below, front.columns);
    auto pivots = x.segment(front.column, front.columns);
    L.topRows(front.columns).triangularView<Eigen::Lower>().solveInPlace(pivots);
    below.noalias() = L.bottomRows(front.below) * pivots;
    for (int r = 0; r < front.below; ++r) x[e.rows[front.row + r]] -= below[r];
  }
  for (int f = fronts - 1; f >= 0; --f) {
    const Front& front = e.fronts[f];
    const Eigen::Map<const MatrixXd> L(
        factor_.data() + front.factor, front.columns + front.below, front.columns);
    auto pivots = x.segment(front.column, front.columns);
    below.resize(front.below);
    for (int r = 0; r < front.below; ++r) below[r] = x[e.rows[front.row + r]];
    pivots.noalias() -= L.bottomRows(front.below).transpose() * below;
    L.topRows(front.columns).triangularView<Eigen::Lower>().transpose().solveInPlace(pivots);
  }
  VectorXd solution(b.size());
  for (Eigen::Index r = 0; r < b.size(); ++r) solution[r] = x[e.place[r]];
  return solution;
}

}  // namespace dqslam
