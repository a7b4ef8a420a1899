#include "dqslam/linear/block_cholesky.h"

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <string>

#include "dqslam/linear/dense_front.h"
#include "dqslam/linear/parallel.h"

namespace dqslam {

using Eigen::VectorXd;

BlockCholesky::BlockCholesky(std::shared_ptr<const Elimination> elimination, int threads)
    : elimination_(std::move(elimination)),
      threads_(threads),
      factor_(elimination_->fronts.back().factor + kFrontPadding) {
  stacks_.resize(elimination_->stack_size.size());
  for (int s = 0; s < 2; ++s) stacks_[s].resize(elimination_->stack_size[s]);
  for (int f = 0; f < elimination_->num_fronts(); ++f) {
    if (elimination_->fronts[f].stack < 2) others_.push_back(f);
  }
}

bool BlockCholesky::Factorize(const BlockMatrix& A, const VectorXd& damping) {
  const size_t rows = elimination_->place.size(), blocks = elimination_->blocks.size();
  if (static_cast<size_t>(A.rows()) != rows || static_cast<size_t>(damping.size()) != rows ||
      static_cast<size_t>(A.num_blocks() + A.num_off_diagonal()) != blocks) {
    throw std::invalid_argument(
        "expected " + std::to_string(rows) + " rows in " + std::to_string(blocks) +
        " blocks and a damping for each row, got " + std::to_string(A.rows()) + " rows in " +
        std::to_string(A.num_blocks() + A.num_off_diagonal()) + " blocks and " +
        std::to_string(damping.size()) + " dampings");
  }
  VectorXd placed_damping(damping.size());
  for (Eigen::Index r = 0; r < damping.size(); ++r) {
    placed_damping[elimination_->place[r]] = damping[r];
  }
  const int subtrees = static_cast<int>(elimination_->subtrees.size());
  std::atomic<bool> positive{true};
  ParallelFor(threads_, subtrees, [&](int s) {
    const auto [begin, end] = elimination_->subtrees[s];
    for (const int stack : {2 * s + 2, 2 * s + 3}) {
      stacks_[stack].resize(elimination_->stack_size[stack]);
    }
    for (int f = begin; f < end && positive; ++f) {
      if (!Eliminate(A, placed_damping, f)) positive = false;
    }
    // Only the update of the last front waits on, at the bottom of its stack.
    const Front& last = elimination_->fronts[end - 1];
    stacks_[last.stack].conservativeResize(std::ptrdiff_t{last.below} * last.below);
    stacks_[last.stack ^ 1].resize(0);
  });
  return positive && std::all_of(others_.begin(), others_.end(), [&](int f) {
           return Eliminate(A, placed_damping, f);
         });
}

bool BlockCholesky::Eliminate(const BlockMatrix& A, const VectorXd& placed_damping, int f) {
  const Front& front = elimination_->fronts[f];
  PlaceBlocks(A, f);
  for (int c = 0; c < front.pivots; ++c) {
    Factor(f)[std::ptrdiff_t{c} * (front.rows() + 1)] += placed_damping[front.pivot + c];
  }
  AddUpdates(f);
  return EliminatePivots(front.pivots, front.rows(), Factor(f), Update(f));
}

// Copies the entries of A into the columns of a front.
void BlockCholesky::PlaceBlocks(const BlockMatrix& A, int f) {
  const Front& front = elimination_->fronts[f];
  const std::ptrdiff_t stride = front.rows();
  std::fill_n(Factor(f), stride * front.pivots, 0.0);
  for (int k = front.block; k < elimination_->fronts[f + 1].block; ++k) {
    const PlacedBlock& placed = elimination_->blocks[k];
    double* to = Factor(f) + placed.column * stride + placed.row;
    if (placed.index < 0) {
      const int block = -1 - placed.index, size = A.size(block);
      const double* from = A.Diagonal(block);
      for (int c = 0; c < size; ++c) {
        for (int r = c; r < size; ++r) to[c * stride + r] = from[c * size + r];
      }
      continue;
    }
    const auto [i, j] = A.coupled(placed.index);
    const double* from = A.OffDiagonal(placed.index);
    const int rows = A.size(i), columns = A.size(j);
    const std::ptrdiff_t down = placed.transposed ? stride : 1;
    const std::ptrdiff_t right = placed.transposed ? 1 : stride;
    for (int c = 0; c < columns; ++c) {
      for (int r = 0; r < rows; ++r) to[c * right + r * down] = from[c * rows + r];
    }
  }
}

// Sets the update of a front to zero, then adds the updates of its children to it and to the
// columns.
void BlockCholesky::AddUpdates(int f) {
  const Front& front = elimination_->fronts[f];
  for (int c = 0; c < front.below; ++c) {
    std::fill_n(Update(f) + std::ptrdiff_t{c} * (front.below + 1), front.below - c, 0.0);
  }
  for (int k = front.child; k < elimination_->fronts[f + 1].child; ++k) {
    const Child& child = elimination_->children[k];
    const RowRun* const end = elimination_->runs.data() + elimination_->children[k + 1].run;
    const std::ptrdiff_t size = elimination_->fronts[child.front].below;
    for (const RowRun* run = elimination_->runs.data() + child.run; run != end; ++run) {
      for (int c = 0; c < run->length; ++c) {
        const double* from = Update(child.front) + (run->from + c) * size;
        const int column = run->to + c;
        double* to =
            column < front.pivots
                ? Factor(f) + std::ptrdiff_t{column} * front.rows()
                : Update(f) + std::ptrdiff_t{column - front.pivots} * front.below - front.pivots;
        for (int r = c; r < run->length; ++r) to[run->to + r] += from[run->from + r];
        for (const RowRun* next = run + 1; next != end; ++next) {
          for (int r = 0; r < next->length; ++r) to[next->to + r] += from[next->from + r];
        }
      }
    }
  }
}

BlockCholesky::Columns BlockCholesky::Pivots(int f) const {
  const Front& front = elimination_->fronts[f];
  return {factor_.data() + front.factor,
          front.pivots,
          front.pivots,
          Eigen::OuterStride<>(front.rows())};
}

BlockCholesky::Columns BlockCholesky::Below(int f) const {
  const Front& front = elimination_->fronts[f];
  return {factor_.data() + front.factor + front.pivots,
          front.below,
          front.pivots,
          Eigen::OuterStride<>(front.rows())};
}

int BlockCholesky::FrontOf(int row) const {
  const auto after =
      std::upper_bound(elimination_->fronts.begin(),
                       elimination_->fronts.end() - 1,
                       row,
                       [](int wanted, const Front& front) { return wanted < front.pivot; });
  return static_cast<int>(after - elimination_->fronts.begin()) - 1;
}

VectorXd BlockCholesky::Solve(const VectorXd& b) const {
  const Elimination& e = *elimination_;
  const int subtrees = static_cast<int>(e.subtrees.size());
  int most_below = 0;
  for (const Front& front : e.fronts) most_below = std::max(most_below, front.below);
  VectorXd x(b.size());
  for (Eigen::Index r = 0; r < b.size(); ++r) x[e.place[r]] = b[r];

  // L y = b, where subtract(r, v) subtracts v from a row below the pivots.
  const auto forward = [&](int f, VectorXd& workspace, const auto& subtract) {
    const Front& front = e.fronts[f];
    auto y = x.segment(front.pivot, front.pivots);
    auto below = workspace.head(front.below);
    Pivots(f).triangularView<Eigen::Lower>().solveInPlace(y);
    below.noalias() = Below(f) * y;
    for (int r = 0; r < front.below; ++r) subtract(e.rows[front.row + r], below[r]);
  };
  // L^T x = y.
  const auto backward = [&](int f, VectorXd& workspace) {
    const Front& front = e.fronts[f];
    auto y = x.segment(front.pivot, front.pivots);
    auto below = workspace.head(front.below);
    for (int r = 0; r < front.below; ++r) below[r] = x[e.rows[front.row + r]];
    y.noalias() -= Below(f).transpose() * below;
    Pivots(f).transpose().triangularView<Eigen::Upper>().solveInPlace(y);
  };

  // What subtrees subtract from rows outside of them, which are the rows below their last fronts.
  std::vector<VectorXd> outside(subtrees);
  ParallelFor(threads_, subtrees, [&](int s) {
    const auto [begin, end] = e.subtrees[s];
    const Front& last = e.fronts[end - 1];
    const auto rows = e.rows.begin() + last.row;
    const int first_outside = last.pivot + last.pivots;
    VectorXd workspace(most_below);
    outside[s] = VectorXd::Zero(last.below);
    for (int f = begin; f < end; ++f) {
      int k = 0;  // rows ascend
      forward(f, workspace, [&](int row, double value) {
        if (row < first_outside) {
          x[row] -= value;
        } else {
          while (rows[k] < row) ++k;
          outside[s][k] += value;
        }
      });
    }
  });
  for (int s = 0; s < subtrees; ++s) {
    const Front& last = e.fronts[e.subtrees[s].end - 1];
    for (int r = 0; r < last.below; ++r) x[e.rows[last.row + r]] -= outside[s][r];
  }
  VectorXd workspace(most_below);
  for (const int f : others_) {
    forward(f, workspace, [&](int row, double value) { x[row] -= value; });
  }
  for (auto f = others_.rbegin(); f != others_.rend(); ++f) backward(*f, workspace);
  ParallelFor(threads_, subtrees, [&](int s) {
    VectorXd own(most_below);
    for (int f = e.subtrees[s].end - 1; f >= e.subtrees[s].begin; --f) backward(f, own);
  });
  VectorXd solution(b.size());
  for (Eigen::Index r = 0; r < b.size(); ++r) solution[r] = x[e.place[r]];
  return solution;
}

}  // namespace dqslam
