#include "dqslam/linear/front_tree.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>

namespace dqslam {
namespace {

using Lists = std::vector<std::vector<int>>;

// Blocks in the order of elimination: approximate minimum degree (Amestoy, Davis & Duff 1996).
// For graphs of boxes this needs less arithmetic than nested dissection of the path.
std::vector<int> MinimumDegree(const BlockPattern& A) {
  const int blocks = A.num_blocks();
  if (blocks == 0) return {};  // Eigen would read an empty sparse matrix out of bounds.
  Eigen::VectorXi entries = Eigen::VectorXi::Ones(blocks);
  for (int index = 0; index < A.num_off_diagonal(); ++index) ++entries[A.coupled(index).first];
  Eigen::SparseMatrix<char> lower(blocks, blocks);
  lower.reserve(entries);
  for (int block = 0; block < blocks; ++block) lower.insert(block, block) = 1;
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    lower.insert(j, i) = 1;
  }
  lower.makeCompressed();
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), order);
  return {order.indices().data(), order.indices().data() + blocks};
}

// The blocks below the diagonal in each block column of the factor, ascending. Columns and blocks
// are positions in `order`; the parent of a column is the first of its blocks.
Lists FactorPattern(const BlockPattern& A, const std::vector<int>& order) {
  const int blocks = A.num_blocks();
  std::vector<int> position(blocks), seen_by(blocks, -1);
  for (int k = 0; k < blocks; ++k) position[order[k]] = k;
  Lists below(blocks), children(blocks);
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    below[std::min(position[i], position[j])].push_back(std::max(position[i], position[j]));
  }
  for (int k = 0; k < blocks; ++k) {
    seen_by[k] = k;
    for (const int row : below[k]) seen_by[row] = k;
    for (const int child : children[k]) {
      for (const int row : below[child]) {
        if (seen_by[row] == k) continue;
        seen_by[row] = k;
        below[k].push_back(row);
      }
    }
    std::sort(below[k].begin(), below[k].end());
    if (!below[k].empty()) children[below[k].front()].push_back(k);
  }
  return below;
}

// Time of a front, in multiplications with addition: its arithmetic, moving its update through
// memory, and a constant overhead. Half or four times these constants change the time of large
// graphs by 10 %.
double Cost(double pivots, double below) {
  constexpr double kPerEntry = 2, kPerFront = 1000;
  const double arithmetic = pivots * pivots * pivots / 6 + pivots * below * (pivots + below) / 2;
  return arithmetic + kPerEntry * below * below / 2 + kPerFront;
}

// The columns of each front, ascending, in the list of its last column; the other lists are empty.
// A child is merged into its parent where that is cheaper, even if the factor then stores zeros.
Lists MergeColumns(const BlockPattern& A, const std::vector<int>& order, const Lists& below) {
  const int blocks = A.num_blocks();
  Lists merged(blocks), children(blocks);
  std::vector<double> pivots(blocks), rows(blocks, 0.0);
  for (int k = 0; k < blocks; ++k) {
    merged[k] = {k};
    pivots[k] = A.size(order[k]);
    for (const int row : below[k]) rows[k] += A.size(order[row]);
    for (const int child : children[k]) {
      // The rows of the child are pivots or rows of the parent, so the parent's rows stay.
      if (Cost(pivots[k] + pivots[child], rows[k]) >
          Cost(pivots[k], rows[k]) + Cost(pivots[child], rows[child])) {
        continue;
      }
      pivots[k] += pivots[child];
      merged[k].insert(merged[k].end(), merged[child].begin(), merged[child].end());
      merged[child].clear();
    }
    std::sort(merged[k].begin(), merged[k].end());
    if (!below[k].empty()) children[below[k].front()].push_back(k);
  }
  return merged;
}

// Orders the children of each front so that few updates wait at a time (Liu 1986). The first child
// is the one whose subtree needs the most memory in addition to its own update.
void SortChildren(const BlockPattern& A,
                  const std::vector<int>& order,
                  const Lists& below,
                  Lists& children) {
  std::vector<double> update(order.size()), peak(order.size());
  for (size_t k = 0; k < order.size(); ++k) {
    double rows = 0, waiting = 0;
    for (const int row : below[k]) rows += A.size(order[row]);
    update[k] = rows * rows;
    std::stable_sort(children[k].begin(), children[k].end(), [&](int a, int b) {
      return peak[a] - update[a] > peak[b] - update[b];
    });
    for (const int child : children[k]) {
      peak[k] = std::max(peak[k], waiting + peak[child]);
      waiting += update[child];
    }
    peak[k] = std::max(peak[k], waiting + update[k]);
  }
}

// The nodes of the trees below `roots` in postorder: each node comes right after its descendants.
std::vector<int> Postorder(const Lists& children, const std::vector<int>& roots) {
  std::vector<int> pending = roots, reversed;
  while (!pending.empty()) {
    const int next = pending.back();
    pending.pop_back();
    reversed.push_back(next);
    pending.insert(pending.end(), children[next].begin(), children[next].end());
  }
  return {reversed.rbegin(), reversed.rend()};
}

}  // namespace

FrontTree::FrontTree(const BlockPattern& A) {
  const std::vector<int> minimum_degree = MinimumDegree(A);
  Lists pattern = FactorPattern(A, minimum_degree);
  const Lists merged = MergeColumns(A, minimum_degree, pattern);

  // Up to here, a front is identified by its last column, which is a position in `minimum_degree`.
  std::vector<int> last_of(A.num_blocks()), roots;
  for (int last = 0; last < A.num_blocks(); ++last) {
    for (const int column : merged[last]) last_of[column] = last;
  }
  Lists children(A.num_blocks());
  for (int last = 0; last < A.num_blocks(); ++last) {
    if (merged[last].empty()) continue;
    if (pattern[last].empty()) {
      roots.push_back(last);
    } else {
      children[last_of[pattern[last].front()]].push_back(last);
    }
  }

  SortChildren(A, minimum_degree, pattern, children);
  const std::vector<int> postorder = Postorder(children, roots);
  std::vector<int> position(A.num_blocks()), front_of(A.num_blocks());
  for (size_t front = 0; front < postorder.size(); ++front) {
    first.push_back(static_cast<int>(order.size()));
    for (const int column : merged[postorder[front]]) {
      front_of[column] = static_cast<int>(front);
      position[column] = static_cast<int>(order.size());
      order.push_back(minimum_degree[column]);
    }
  }
  first.push_back(A.num_blocks());
  for (const int last : postorder) {
    std::vector<int>& rows = pattern[last];
    parent.push_back(rows.empty() ? -1 : front_of[rows.front()]);
    for (int& row : rows) row = position[row];
    std::sort(rows.begin(), rows.end());
    below.push_back(std::move(rows));
  }
}

}  // namespace dqslam
