#include "dqslam/elimination.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <numeric>

namespace dqslam {
namespace {

using Lists = std::vector<std::vector<int>>;

// Blocks in the order of elimination: approximate minimum degree (Amestoy, Davis & Duff 1996).
// Of graphs of boxes it makes a cheaper factor than cutting the drive into halves does.
std::vector<int> MinimumDegree(const BlockMatrix& A) {
  const int blocks = A.num_blocks();
  Eigen::VectorXi degree = Eigen::VectorXi::Ones(blocks);
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    ++degree[i];
    ++degree[j];
  }
  Eigen::SparseMatrix<char> pattern(blocks, blocks);
  pattern.reserve(degree);
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    pattern.insert(i, j) = 1;
    pattern.insert(j, i) = 1;
  }
  for (int b = 0; b < blocks; ++b) pattern.insert(b, b) = 1;  // AMDOrdering wants the diagonal too
  pattern.makeCompressed();
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);
  return {order.indices().data(), order.indices().data() + blocks};
}

std::vector<int> Inverse(const std::vector<int>& order) {
  std::vector<int> position(order.size());
  for (size_t k = 0; k < order.size(); ++k) position[order[k]] = static_cast<int>(k);
  return position;
}

// The blocks below the diagonal in each block column of the factor, ascending. Columns and blocks
// are positions in `order`; the parent of a column is the first of its blocks.
Lists FactorPattern(const BlockMatrix& A, const std::vector<int>& order) {
  const std::vector<int> position = Inverse(order);
  Lists below(order.size()), children(order.size());
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    below[std::min(position[i], position[j])].push_back(std::max(position[i], position[j]));
  }
  std::vector<int> seen(order.size(), -1);
  for (int k = 0; k < static_cast<int>(order.size()); ++k) {
    seen[k] = k;
    for (const int row : below[k]) seen[row] = k;
    for (const int child : children[k]) {
      for (const int row : below[child]) {
        if (seen[row] == k) continue;
        seen[row] = k;
        below[k].push_back(row);
      }
    }
    std::sort(below[k].begin(), below[k].end());
    if (!below[k].empty()) children[below[k].front()].push_back(k);
  }
  return below;
}

// Time of a front, in multiplications with addition: arithmetic, the update's way through memory,
// and what it takes to begin..
double Cost(double columns, double below) {
  constexpr double kPerEntry = 2, kPerFront = 1000;
  const double arithmetic =
      columns * columns * columns / 6 + columns * below * (columns + below) / 2;
  return arithmetic + kPerEntry * below * below / 2 + kPerFront;
}

// The columns of each front in the list of the last of them, ascending; other lists are empty.
// A child joins its parent where that is cheaper, though the factor then stores zeros.
Lists MergeColumns(const BlockMatrix& A, const std::vector<int>& order, const Lists& below) {
  Lists merged(order.size()), children(order.size());
  std::vector<double> columns(order.size()), rows(order.size());
  for (int k = 0; k < static_cast<int>(order.size()); ++k) {
    merged[k] = {k};
    columns[k] = A.size(order[k]);
    for (const int row : below[k]) rows[k] += A.size(order[row]);
    for (const int child : children[k]) {
      // All rows of the child, but those that join as pivots, are rows of the parent.
      if (Cost(columns[k] + columns[child], rows[k]) >
          Cost(columns[k], rows[k]) + Cost(columns[child], rows[child])) {
        continue;
      }
      columns[k] += columns[child];
      merged[k].insert(merged[k].end(), merged[child].begin(), merged[child].end());
      merged[child].clear();
    }
    std::sort(merged[k].begin(), merged[k].end());
    if (!below[k].empty()) children[below[k].front()].push_back(k);
  }
  return merged;
}

// A tree of fronts by blocks, in terms of positions in the final order.
struct Tree {
  std::vector<int> order;   // blocks
  std::vector<int> first;   // position of each front's first pivot; one more ends the last
  std::vector<int> parent;  // fronts, -1: none; children come before their parents
  Lists below;
};

// Fronts of the tree below and including the roots, each named by the position of its last column,
// each right after its subtrees.
std::vector<int> Postorder(const Lists& children, std::vector<int> roots) {
  std::vector<int> reversed;
  std::vector<int>& pending = roots;
  while (!pending.empty()) {
    const int front = pending.back();
    pending.pop_back();
    reversed.push_back(front);
    pending.insert(pending.end(), children[front].begin(), children[front].end());
  }
  return {reversed.rbegin(), reversed.rend()};
}

Tree BuildTree(const BlockMatrix& A) {
  const std::vector<int> minimum_degree = MinimumDegree(A);
  Lists below = FactorPattern(A, minimum_degree);
  const Lists merged = MergeColumns(A, minimum_degree, below);
  const int blocks = A.num_blocks();

  std::vector<int> last_of(blocks), roots;  // last column of the front that a column is in
  Lists children(blocks);
  for (int k = 0; k < blocks; ++k) {
    for (const int column : merged[k]) last_of[column] = k;
  }
  for (int k = 0; k < blocks; ++k) {
    if (merged[k].empty()) continue;
    (below[k].empty() ? roots : children[last_of[below[k].front()]]).push_back(k);
  }

  Tree tree;
  std::vector<int> position(blocks), front_of(blocks);
  const std::vector<int> postorder = Postorder(children, roots);
  for (const int k : postorder) {
    tree.first.push_back(static_cast<int>(tree.order.size()));
    for (const int column : merged[k]) {
      position[column] = static_cast<int>(tree.order.size());
      front_of[column] = static_cast<int>(tree.first.size()) - 1;
      tree.order.push_back(minimum_degree[column]);
    }
  }
  tree.first.push_back(blocks);
  for (const int k : postorder) {
    tree.parent.push_back(below[k].empty() ? -1 : front_of[below[k].front()]);
    for (int& row : below[k]) row = position[row];
    std::sort(below[k].begin(), below[k].end());
    tree.below.push_back(std::move(below[k]));
  }
  return tree;
}

}  // namespace

Elimination::Elimination(const BlockMatrix& A) {
  const Tree tree = BuildTree(A);
  const int num_fronts = static_cast<int>(tree.parent.size());
  const std::vector<int> position = Inverse(tree.order);

  std::vector<int> start(1, 0), front_of(A.num_blocks());
  for (const int block : tree.order) start.push_back(start.back() + A.size(block));
  for (int front = 0; front < num_fronts; ++front) {
    std::fill(
        front_of.begin() + tree.first[front], front_of.begin() + tree.first[front + 1], front);
  }
  place.resize(A.rows());
  for (int block = 0; block < A.num_blocks(); ++block) {
    std::iota(place.begin() + A.offset(block),
              place.begin() + A.offset(block + 1),
              start[position[block]]);
  }

  Lists children_of(num_fronts), blocks_of(num_fronts);
  std::vector<int> stack(num_fronts, 0);
  for (int front = num_fronts - 1; front >= 0; --front) {
    if (tree.parent[front] >= 0) stack[front] = 1 - stack[tree.parent[front]];
  }
  for (int front = 0; front < num_fronts; ++front) {
    if (tree.parent[front] >= 0) children_of[tree.parent[front]].push_back(front);
  }
  for (int block = 0; block < A.num_blocks(); ++block) {
    blocks_of[front_of[position[block]]].push_back(-1 - block);
  }
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    blocks_of[front_of[std::min(position[i], position[j])]].push_back(index);
  }

  std::vector<int> at(A.num_blocks());  // first row of a block within the front at hand
  std::ptrdiff_t factor_size = 0, stack_top[2] = {0, 0};
  for (int f = 0; f < num_fronts; ++f) {
    Front front;
    front.column = start[tree.first[f]];
    front.columns = start[tree.first[f + 1]] - front.column;
    front.below = 0;
    front.row = static_cast<int>(rows.size());
    front.block = static_cast<int>(blocks.size());
    front.child = static_cast<int>(children.size());
    for (int k = tree.first[f]; k < tree.first[f + 1]; ++k) at[k] = start[k] - front.column;
    for (const int k : tree.below[f]) {
      at[k] = front.columns + front.below;
      front.below += start[k + 1] - start[k];
      for (int row = start[k]; row < start[k + 1]; ++row) rows.push_back(row);
    }

    for (const int index : blocks_of[f]) {
      if (index < 0) {
        const int k = at[position[-1 - index]];
        blocks.push_back({index, k, k, false});
      } else {
        const auto [i, j] = A.coupled(index);
        const bool transposed = position[i] < position[j];
        const int row = at[position[transposed ? j : i]], column = at[position[transposed ? i : j]];
        blocks.push_back({index, row, column, transposed});
      }
    }

    for (const int child : children_of[f]) {
      children.push_back({child, static_cast<int>(runs.size())});
      int from = 0;
      for (const int k : tree.below[child]) {
        const int length = start[k + 1] - start[k];
        if (from > 0 && runs.back().to + runs.back().length == at[k]) {
          runs.back().length += length;
        } else {
          runs.push_back({from, at[k], length});
        }
        from += length;
      }
    }

    front.factor = factor_size;
    factor_size += std::ptrdiff_t{front.columns + front.below} * front.columns;
    front.stack = stack[f];
    if (!children_of[f].empty()) stack_top[1 - stack[f]] = fronts[children_of[f].front()].update;
    front.update = stack_top[stack[f]];
    stack_top[stack[f]] += std::ptrdiff_t{front.below} * front.below;
    stack_size[stack[f]] = std::max(stack_size[stack[f]], stack_top[stack[f]]);
    fronts.push_back(front);
  }
  Front end = {};
  end.row = static_cast<int>(rows.size());
  end.block = static_cast<int>(blocks.size());
  end.child = static_cast<int>(children.size());
  end.factor = factor_size;
  fronts.push_back(end);
  children.push_back({num_fronts, static_cast<int>(runs.size())});
}

}  // namespace dqslam
