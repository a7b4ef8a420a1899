#include "dqslam/linear/selected_inverse.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace dqslam {
namespace {

using Eigen::Lower;
using Eigen::MatrixXd;

using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// The place of a row among the rows of a front: its pivots, then the rows below them.
int PositionIn(const Elimination& elimination, int f, int row) {
  const Front& front = elimination.fronts[f];
  if (row < front.pivot + front.pivots) return row - front.pivot;
  const auto begin = elimination.rows.begin() + front.row, end = begin + front.below;
  const auto found = std::lower_bound(begin, end, row);
  if (found == end || *found != row) return -1;
  return front.pivots + static_cast<int>(found - begin);
}

}  // namespace

SelectedInverse::SelectedInverse(const BlockMatrix& A, const BlockCholesky& cholesky)
    : A_(A), cholesky_(cholesky), inverse_(cholesky.elimination().fronts.back().factor) {
  for (int f = cholesky.elimination().num_fronts() - 1; f >= 0; --f) Invert(f);
}

// With L of a front in two parts, P at its pivots and B below them, and M = L_B L_P^-1:
//   Z_BP = -Z_BB M,   Z_PP = L_P^-T L_P^-1 - M^T Z_BP.
void SelectedInverse::Invert(int f) {
  const Front& front = cholesky_.elimination().fronts[f];
  const BlockCholesky::Columns pivots = cholesky_.Pivots(f);
  const auto L = pivots.triangularView<Lower>();
  MatrixXd M = cholesky_.Below(f);
  L.solveInPlace<Eigen::OnTheRight>(M);
  MatrixXd root = MatrixXd::Identity(front.pivots, front.pivots);
  L.solveInPlace(root);
  Eigen::Map<MatrixXd> Z(inverse_.data() + front.factor, front.rows(), front.pivots);
  Z.bottomRows(front.below).noalias() = -Below(f) * M;
  Z.topRows(front.pivots).noalias() = root.transpose() * root;
  Z.topRows(front.pivots).noalias() -= M.transpose() * Z.bottomRows(front.below);
}

// The inverse at the rows below a front's pivots: all are in the fronts above, which are known.
MatrixXd SelectedInverse::Below(int f) const {
  const Elimination& elimination = cholesky_.elimination();
  const Front& front = elimination.fronts[f];
  const int* const rows = elimination.rows.data() + front.row;
  MatrixXd Z(front.below, front.below);
  std::vector<int> position(front.below);
  for (int begin = 0, end = 0; begin < front.below; begin = end) {
    const int above = cholesky_.FrontOf(rows[begin]);
    const Front& g = elimination.fronts[above];
    while (end < front.below && rows[end] < g.pivot + g.pivots) ++end;
    for (int r = begin; r < front.below; ++r) {
      position[r] = PositionIn(elimination, above, rows[r]);
    }
    for (int c = begin; c < end; ++c) {
      const double* const column =
          inverse_.data() + g.factor + std::ptrdiff_t{rows[c] - g.pivot} * g.rows();
      for (int r = c; r < front.below; ++r) Z(r, c) = Z(c, r) = column[position[r]];
    }
  }
  return Z;
}

MatrixXd SelectedInverse::Block(int i, int j) const {
  const Elimination& elimination = cholesky_.elimination();
  const int at_i = elimination.place[A_.offset(i)], at_j = elimination.place[A_.offset(j)];
  if (at_i < at_j) return Block(j, i).transpose();
  const int f = cholesky_.FrontOf(at_j);
  const Front& front = elimination.fronts[f];
  const int row = PositionIn(elimination, f, at_i);
  if (row < 0) {
    throw std::invalid_argument("blocks " + std::to_string(i) + " and " + std::to_string(j) +
                                " are not coupled");
  }
  const Eigen::Map<const MatrixXd> Z(inverse_.data() + front.factor, front.rows(), front.pivots);
  return Z.block(row, at_j - front.pivot, A_.size(i), A_.size(j));
}

MatrixXd InverseAt(const BlockCholesky& cholesky, const std::vector<int>& rows) {
  const Elimination& elimination = cholesky.elimination();
  const int fronts = elimination.num_fronts(), columns = static_cast<int>(rows.size());
  // A unit vector reaches its own front and those above it, and what it reaches depends on no more.
  std::vector<char> is_reached(fronts, false);
  for (const int row : rows) {
    int f = cholesky.FrontOf(elimination.place[row]);
    while (!is_reached[f]) {
      is_reached[f] = true;
      const Front& front = elimination.fronts[f];
      if (front.below > 0) f = cholesky.FrontOf(elimination.rows[front.row]);
    }
  }
  std::vector<int> reached, start(fronts);
  int size = 0;
  for (int f = 0; f < fronts; ++f) {
    if (!is_reached[f]) continue;
    reached.push_back(f);
    start[f] = size;
    size += elimination.fronts[f].pivots;
  }
  const auto place = [&](int row) {
    const int f = cholesky.FrontOf(row);
    return start[f] + row - elimination.fronts[f].pivot;
  };

  RowMajorMatrix X = RowMajorMatrix::Zero(size, columns);
  for (int c = 0; c < columns; ++c) X(place(elimination.place[rows[c]]), c) = 1;
  for (const int f : reached) {
    const Front& front = elimination.fronts[f];
    auto own = X.middleRows(start[f], front.pivots);
    cholesky.Pivots(f).triangularView<Lower>().solveInPlace(own);
    const RowMajorMatrix below = cholesky.Below(f) * own;
    for (int r = 0; r < front.below; ++r) {
      X.row(place(elimination.rows[front.row + r])) -= below.row(r);
    }
  }
  for (auto f = reached.rbegin(); f != reached.rend(); ++f) {
    const Front& front = elimination.fronts[*f];
    RowMajorMatrix below(front.below, columns);
    for (int r = 0; r < front.below; ++r) {
      below.row(r) = X.row(place(elimination.rows[front.row + r]));
    }
    auto own = X.middleRows(start[*f], front.pivots);
    own.noalias() -= cholesky.Below(*f).transpose() * below;
    cholesky.Pivots(*f).transpose().triangularView<Eigen::Upper>().solveInPlace(own);
  }
  MatrixXd inverse(columns, columns);
  for (int r = 0; r < columns; ++r) inverse.row(r) = X.row(place(elimination.place[rows[r]]));
  return inverse;
}

}  // namespace dqslam
