// Normal equations of a chain of poses and the objects they observe, eliminated pose by pose.
//
// The problem is to minimize sum |r + J x|^2 / 2 over objects and over poses x_b .. x_e, where
// odometry ties each pose only to the next one.  A pose is eliminated when the next one is added,
// an object after its last observation.  Only the front is kept: the present pose and the objects
// that have observations to come.  The time is linear in the number of poses and quadratic in the
// number of objects in the front.
#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <vector>

#include "dqslam/geometry/blocks.h"

namespace dqslam {

template <int k>
class ChainElimination {
 public:
  using Square = Eigen::Matrix<double, k, k>;
  using Column = Eigen::Matrix<double, k, 1>;

  /// Starts a new chain.  A damping lambda adds Marquardt's lambda diag(J^T J).
  void Reset(double damping) {
    damping_ = damping;
    used_ = 0;
    names_.clear();
    free_.clear();
    records_.clear();
    arena_.clear();
    front_.topLeftCorner(k, k).setZero();
    rhs_.template head<k>().setZero();
  }

  /// Adds an object to the front and returns its slot.  BackSubstitute() passes on its `name`.
  int AddObject(int name) {
    if (!free_.empty()) {
      const int slot = free_.back();
      free_.pop_back();
      names_[slot] = name;
      return slot;
    }
    const int slot = used_++;
    names_.push_back(name);
    const int size = k + 9 * used_;
    if (size > front_.rows()) {
      const Eigen::Index capacity = std::max<Eigen::Index>(2 * front_.rows(), k + 9 * 8);
      front_.conservativeResize(capacity, capacity);
      rhs_.conservativeResize(capacity);
    }
    front_.block(At(slot), 0, 9, size).setZero();
    rhs_.template segment<9>(At(slot)).setZero();
    return slot;
  }

  /// Adds information H and gradient g to the present pose, or to an object.
  void AddPose(const Square& H, const Column& g) {
    AddDamped(H, front_.template block<k, k>(0, 0));
    rhs_.template head<k>() -= g;
  }
  void AddObjectInformation(int slot, const Matrix9d& H, const Vector9d& g) {
    AddDamped(H, front_.template block<9, 9>(At(slot), At(slot)));
    rhs_.template segment<9>(At(slot)) -= g;
  }
  /// Adds a residual between the present pose and an object.
  void AddObservation(int slot,
                      const Eigen::Vector4d& r,
                      const Eigen::Matrix<double, 4, k>& by_pose,
                      const Eigen::Matrix<double, 4, 9>& by_object) {
    AddPose(by_pose.transpose() * by_pose, by_pose.transpose() * r);
    AddObjectInformation(slot, by_object.transpose() * by_object, by_object.transpose() * r);
    front_.template block<9, k>(At(slot), 0).noalias() += by_object.transpose() * by_pose;
  }

  /// Adds odometry to the next pose, which becomes the present one, and eliminates the pose before.
  /// Returns false where the equations are not positive definite.
  bool NextPose(const Column& r, const Square& by_from, const Square& by_to) {
    AddPose(by_from.transpose() * by_from, by_from.transpose() * r);
    const Square to_next = by_from.transpose() * by_to;
    if (!EliminatePose(&to_next)) return false;
    AddPose(by_to.transpose() * by_to, by_to.transpose() * r);
    return true;
  }

  bool EliminateObject(int slot) {
    const int at = At(slot), behind = at + 9, size = k + 9 * used_;
    of_object_.resize(size, 9);
    of_object_.topRows(at) = front_.block(at, 0, 9, at).transpose();
    of_object_.middleRows(at, 9).setZero();
    of_object_.bottomRows(size - behind) = front_.block(behind, at, size - behind, 9);
    if (!Eliminate(slot, at, &of_object_)) return false;
    free_.push_back(slot);
    return true;
  }

  /// Eliminates the present pose and the remaining objects.
  bool Finish() {
    if (!EliminatePose(nullptr)) return false;
    std::vector<bool> is_free(used_, false);
    for (const int slot : free_) is_free[slot] = true;
    for (int slot = used_ - 1; slot >= 0; --slot) {
      if (!is_free[slot] && !EliminateObject(slot)) return false;
    }
    return true;
  }

  /// The largest number of objects that the front had at a time.
  int most_objects() const { return used_; }

  /// Computes the steps in the reverse order of elimination.  Calls visit_pose(step) for each pose,
  /// from the last to the first, and visit_object(name, step) for each object.
  template <typename VisitPose, typename VisitObject>
  void BackSubstitute(VisitPose&& visit_pose, VisitObject&& visit_object) {
    solution_ = Eigen::VectorXd::Zero(k + 9 * used_);
    for (auto record = records_.rbegin(); record != records_.rend(); ++record) {
      const double* data = arena_.data() + record->offset;
      if (record->slot < 0) {
        // The first entries of the front belong to the pose after this one.
        const Column step = Substitute<k>(data, record->size);
        solution_.template head<k>() = step;
        visit_pose(step);
      } else {
        const Vector9d step = Substitute<9>(data, record->size);
        solution_.template segment<9>(At(record->slot)) = step;
        visit_object(record->name, step);
      }
    }
  }

 private:
  struct Entry {
    int slot;       ///< of an object; -1 for a pose
    int name;       ///< of an object
    int size;       ///< of the front
    size_t offset;  ///< in arena_
  };

  int At(int slot) const { return k + 9 * slot; }

  template <typename H, typename Block>
  void AddDamped(const H& information, Block&& block) {
    block += information;
    block.diagonal() += damping_ * information.diagonal();
  }

  // Eliminates the present pose; `to_next` couples it to the next pose and is null for the last.
  bool EliminatePose(const Square* to_next) {
    const int m = 9 * used_;
    of_pose_.resize(k + m, k);
    of_pose_.template topRows<k>() = to_next ? Square(to_next->transpose()) : Square::Zero();
    of_pose_.bottomRows(m) = front_.block(k, 0, m, k);
    return Eliminate(-1, 0, &of_pose_);
  }

  // Subtracts the Schur complement of the eliminated variable from the front; `panel` couples the
  // two.
  template <int n>
  bool Eliminate(int slot, int at, Eigen::Matrix<double, Eigen::Dynamic, n>* panel) {
    const int size = static_cast<int>(panel->rows());
    const Eigen::LLT<Eigen::Matrix<double, n, n>> cholesky(
        Eigen::Matrix<double, n, n>(front_.template block<n, n>(at, at)));
    const Eigen::Matrix<double, n, 1> h =
        cholesky.matrixL().solve(Eigen::Matrix<double, n, 1>(rhs_.template segment<n>(at)));
    if (cholesky.info() != Eigen::Success || !h.allFinite()) return false;
    front_.block(at, 0, n, size).setZero();
    front_.block(at, at, size - at, n).setZero();
    rhs_.template segment<n>(at).setZero();
    cholesky.matrixU().template solveInPlace<Eigen::OnTheRight>(*panel);
    for (int column = 0; column < size; ++column) {
      const Eigen::Matrix<double, n, 1> factor = panel->row(column).transpose();
      if (factor.isZero(0)) continue;
      front_.col(column).segment(column, size - column).noalias() -=
          panel->bottomRows(size - column).lazyProduct(factor);
    }
    rhs_.head(size).noalias() -= *panel * h;
    records_.push_back({slot, slot < 0 ? -1 : names_[slot], size, arena_.size()});
    const double* L = cholesky.matrixLLT().data();
    arena_.insert(arena_.end(), L, L + n * n);
    arena_.insert(arena_.end(), h.data(), h.data() + n);
    arena_.insert(arena_.end(), panel->data(), panel->data() + n * size);
    return true;
  }

  // x = L^-T (h - panel^T x_front)
  template <int n>
  Eigen::Matrix<double, n, 1> Substitute(const double* data, int size) const {
    const Eigen::Map<const Eigen::Matrix<double, n, n>> L(data);
    const Eigen::Map<const Eigen::Matrix<double, n, 1>> h(data + n * n);
    const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, n>> panel(
        data + n * n + n, size, n);
    Eigen::Matrix<double, n, 1> x = h;
    x.noalias() -= panel.transpose() * solution_.head(size);
    L.template triangularView<Eigen::Lower>().transpose().solveInPlace(x);
    return x;
  }

  double damping_ = 0;
  int used_ = 0;
  std::vector<int> names_;  ///< of the objects, by slot
  std::vector<int> free_;
  std::vector<Entry> records_;
  std::vector<double> arena_;
  Eigen::MatrixXd front_ = Eigen::MatrixXd::Zero(k + 9 * 8, k + 9 * 8);
  Eigen::VectorXd rhs_ = Eigen::VectorXd::Zero(k + 9 * 8);
  Eigen::VectorXd solution_;
  Eigen::Matrix<double, Eigen::Dynamic, k> of_pose_;
  Eigen::Matrix<double, Eigen::Dynamic, 9> of_object_;
};

}  // namespace dqslam
