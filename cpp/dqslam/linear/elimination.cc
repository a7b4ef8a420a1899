#include "dqslam/linear/elimination.h"

#include <algorithm>
#include <numeric>

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
  Layout(const BlockMatrix& A, const FrontTree& tree, Elimination& out)
      : A_(A), tree_(tree), children_(ChildrenOf(tree)), out_(out) {
    position_.resize(A.num_blocks());
    at_.resize(A.num_blocks());
    for (int k = 0; k < A.num_blocks(); ++k) {
      position_[tree.order[k]] = k;
      start_.push_back(start_.back() + A.size(tree.order[k]));
    }
    SortBlocks();
    stack_.resize(tree.num_fronts());
    for (int front = tree.num_fronts() - 1; front >= 0; --front) {
      stack_[front] = tree.parent[front] < 0 ? 0 : 1 - stack_[tree.parent[front]];
    }
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

  // The updates of a front's children are on top of their stack, because of all updates that wait
  // they were formed last. The front's own update goes to the other stack, so it needs no copy.
  void PlaceUpdate(int f, Front& front) {
    front.stack = stack_[f];
    if (!children_[f].empty()) {
      stack_top_[1 - front.stack] = out_.fronts[children_[f].front()].update;
    }
    std::ptrdiff_t& top = stack_top_[front.stack];
    front.update = top;
    top += std::ptrdiff_t{front.below} * front.below;
    out_.stack_size[front.stack] = std::max(out_.stack_size[front.stack], top);
  }

  const BlockMatrix& A_;
  const FrontTree& tree_;
  const Lists children_;
  Elimination& out_;
  std::vector<int> position_;     // of each block
  std::vector<int> start_ = {0};  // first row at each position, in the order of elimination
  std::vector<int> at_;           // row within the front at hand where a position begins
  std::vector<int> stack_;        // of each front
  Lists blocks_;                  // of each front, as in PlacedBlock::index
  std::ptrdiff_t factor_size_ = 0, stack_top_[2] = {0, 0};
};

}  // namespace

Elimination::Elimination(const BlockMatrix& A) {
  const FrontTree tree(A);
  Layout layout(A, tree, *this);
  layout.PlaceRows();
  for (int front = 0; front < tree.num_fronts(); ++front) layout.AddFront(front);
  layout.Finish();
}

}  // namespace dqslam
