#include "dqslam/linear/elimination.h"

#include <algorithm>
#include <numeric>

#include "dqslam/linear/dense_front.h"
#include "dqslam/linear/front_tree.h"

namespace dqslam {
namespace {

using Lists = std::vector<std::vector<int>>;

Lists ChildrenOf(const FrontTree& tree) {
  Lists children(tree.num_fronts());
  for (int front = 0; front < tree.num_fronts(); ++front) {
    if (tree.parent[front] >= 0) children[tree.parent[front]].push_back(front);
  }
  return children;
}

// Fills an Elimination, front by front.
class Layout {
 public:
  Layout(const BlockPattern& A, const FrontTree& tree, Elimination& out)
      : A_(A), tree_(tree), children_(ChildrenOf(tree)), out_(out) {
    position_.resize(A.num_blocks());
    at_.resize(A.num_blocks());
    for (int k = 0; k < A.num_blocks(); ++k) {
      position_[tree.order[k]] = k;
      start_.push_back(start_.back() + A.size(tree.order[k]));
    }
    SortBlocks();
    ChooseStacks();
  }

  void PlaceRows() {
    out_.place.resize(A_.rows());
    for (int block = 0; block < A_.num_blocks(); ++block) {
      const auto begin = out_.place.begin() + A_.offset(block);
      std::iota(begin, begin + A_.size(block), start_[position_[block]]);
    }
  }

  void AddFront(int f) {
    Front front = Begin();
    const int first = tree_.first[f], last = tree_.first[f + 1];
    front.pivot = start_[first];
    front.pivots = start_[last] - start_[first];
    for (int k = first; k < last; ++k) at_[k] = start_[k] - start_[first];
    for (const int k : tree_.below[f]) {
      at_[k] = front.rows();
      front.below += Size(k);
      for (int row = start_[k]; row < start_[k + 1]; ++row) out_.rows.push_back(row);
    }
    for (const int index : blocks_[f]) AddBlock(index);
    for (const int child : children_[f]) AddChild(child);
    factor_size_ += std::ptrdiff_t{front.rows()} * front.pivots;
    if (ends_subtree_[f]) factor_size_ += kFrontPadding;
    PlaceUpdate(f, front);
    out_.fronts.push_back(front);
  }

  void Finish() {
    out_.fronts.push_back(Begin());
    out_.children.push_back({-1, static_cast<int>(out_.runs.size())});
  }

 private:
  int Size(int position) const { return start_[position + 1] - start_[position]; }

  // A block belongs to the front in which the first of its two blocks is a pivot.
  void SortBlocks() {
    std::vector<int> front_of(A_.num_blocks());
    for (int front = 0; front < tree_.num_fronts(); ++front) {
      std::fill(
          front_of.begin() + tree_.first[front], front_of.begin() + tree_.first[front + 1], front);
    }
    blocks_.resize(tree_.num_fronts());
    for (int block = 0; block < A_.num_blocks(); ++block) {
      blocks_[front_of[position_[block]]].push_back(-1 - block);
    }
    for (int index = 0; index < A_.num_off_diagonal(); ++index) {
      const auto [i, j] = A_.coupled(index);
      blocks_[front_of[std::min(position_[i], position_[j])]].push_back(index);
    }
  }

  // A front and its children alternate between the two stacks of their subtree.
  void ChooseStacks() {
    const int fronts = tree_.num_fronts();
    std::vector<double> cost;
    for (int f = 0; f < fronts; ++f) {
      const double pivots = start_[tree_.first[f + 1]] - start_[tree_.first[f]];
      double rows = pivots;
      for (const int k : tree_.below[f]) rows += Size(k);
      cost.push_back(pivots * rows * rows / 2);
    }
    out_.subtrees = SplitTree(tree_.parent, cost);
    stack_.assign(fronts, 0);
    ends_subtree_.assign(fronts, false);
    for (size_t s = 0; s < out_.subtrees.size(); ++s) {
      const auto [begin, end] = out_.subtrees[s];
      std::fill(stack_.begin() + begin, stack_.begin() + end, 2 * static_cast<int>(s + 1));
      ends_subtree_[end - 1] = true;
    }
    for (int f = fronts - 1; f >= 0; --f) {
      if (tree_.parent[f] >= 0) stack_[f] += 1 - stack_[tree_.parent[f]] % 2;
    }
    out_.stack_size.assign(2 * (out_.subtrees.size() + 1), 0);
    stack_top_ = out_.stack_size;
  }

  Front Begin() const {
    Front front = {};
    front.row = static_cast<int>(out_.rows.size());
    front.block = static_cast<int>(out_.blocks.size());
    front.child = static_cast<int>(out_.children.size());
    front.factor = factor_size_;
    return front;
  }

  void AddBlock(int index) {
    if (index < 0) {
      const int at = at_[position_[-1 - index]];
      out_.blocks.push_back({index, at, at, false});
      return;
    }
    const auto [i, j] = A_.coupled(index);
    const bool transposed = position_[i] < position_[j];
    const int row = transposed ? j : i, column = transposed ? i : j;
    out_.blocks.push_back({index, at_[position_[row]], at_[position_[column]], transposed});
  }

  void AddChild(int child) {
    out_.children.push_back({child, static_cast<int>(out_.runs.size())});
    int from = 0;
    for (const int k : tree_.below[child]) {
      if (from > 0 && out_.runs.back().to + out_.runs.back().length == at_[k]) {
        out_.runs.back().length += Size(k);
      } else {
        out_.runs.push_back({from, at_[k], Size(k)});
      }
      from += Size(k);
    }
  }

  // The updates of a front's children in its subtree are on top of their stack, because of all
  // updates that wait there they were formed last. The front's own update goes to the other stack,
  // so it needs no copy.
  void PlaceUpdate(int f, Front& front) {
    front.stack = stack_[f];
    const int of_children = front.stack ^ 1;
    const auto first = std::find_if(children_[f].begin(), children_[f].end(), [&](int child) {
      return stack_[child] == of_children;
    });
    if (first != children_[f].end()) stack_top_[of_children] = out_.fronts[*first].update;
    std::ptrdiff_t& top = stack_top_[front.stack];
    front.update = top;
    top += std::ptrdiff_t{front.below} * front.below;
    out_.stack_size[front.stack] = std::max(out_.stack_size[front.stack], top);
  }

  const BlockPattern& A_;
  const FrontTree& tree_;
  const Lists children_;
  Elimination& out_;
  std::vector<int> position_;     // of each block
  std::vector<int> start_ = {0};  // first row at each position, in the order of elimination
  std::vector<int> at_;           // row within the front at hand where a position begins
  std::vector<int> stack_;        // of each front
  std::vector<bool> ends_subtree_;
  Lists blocks_;  // of each front, as in PlacedBlock::index
  std::ptrdiff_t factor_size_ = 0;
  std::vector<std::ptrdiff_t> stack_top_;
};

}  // namespace

Elimination::Elimination(const BlockPattern& A) {
  const FrontTree tree(A);
  Layout layout(A, tree, *this);
  layout.PlaceRows();
  for (int front = 0; front < tree.num_fronts(); ++front) layout.AddFront(front);
  layout.Finish();
}

}  // namespace dqslam
