#include "dqslam/tracks/chain_factor.h"

#include <cmath>

namespace dqslam::tracks {

std::optional<ChainFactor> ChainFactor::Make(const Equations& equations, double damping) {
  ChainFactor factor;
  if (!factor.Factorize(equations, damping)) return std::nullopt;
  return factor;
}

bool ChainFactor::Factorize(const Equations& equations, double damping) {
  const Eigen::Index count = equations.of_boxes.rows();
  own_.resize(count);
  below_.resize(count - 1);
  for (Eigen::Index row = 0; row < count; ++row) {
    StateMatrix block = equations.diagonal.middleRows<6>(6 * row);
    block.diagonal() += damping * equations.of_boxes.row(row).transpose();
    if (row > 0) {
      const StateMatrix transposed = equations.below.middleRows<6>(6 * row - 6).transpose();
      below_[row - 1] = own_[row - 1].triangularView<Eigen::Lower>().solve(transposed).transpose();
      block -= below_[row - 1] * below_[row - 1].transpose();
    }
    const Eigen::LLT<StateMatrix> factor(block);
    if (factor.info() != Eigen::Success) return false;
    own_[row] = factor.matrixL();
  }
  border_ = reduced_ = equations.border;
  SolveChain(reduced_);
  Eigen::Matrix3d corner = equations.corner - border_.transpose() * reduced_;
  corner.diagonal() += damping * equations.corner.diagonal();
  corner_.compute(corner);
  return corner_.info() == Eigen::Success;
}

void ChainFactor::SolveChain(Eigen::Ref<RowMatrix> right) const {
  const Eigen::Index count = own_.size();
  for (Eigen::Index row = 0; row < count; ++row) {
    auto here = right.middleRows<6>(6 * row);
    if (row > 0) here.noalias() -= below_[row - 1] * right.middleRows<6>(6 * row - 6);
    own_[row].triangularView<Eigen::Lower>().solveInPlace(here);
  }
  for (Eigen::Index row = count; row-- > 0;) {
    auto here = right.middleRows<6>(6 * row);
    if (row + 1 < count) {
      here.noalias() -= below_[row].transpose() * right.middleRows<6>(6 * row + 6);
    }
    own_[row].transpose().triangularView<Eigen::Upper>().solveInPlace(here);
  }
}

RowMatrix ChainFactor::Solve(const RowMatrix& right) const {
  RowMatrix result = right;
  auto states = result.topRows(border_.rows());
  SolveChain(states);
  const RowMatrix size = corner_.solve(right.bottomRows<3>() - border_.transpose() * states);
  states.noalias() -= reduced_ * size;
  result.bottomRows<3>() = size;
  return result;
}

double ChainFactor::LogDeterminant() const {
  double sum = corner_.matrixLLT().diagonal().array().log().sum();
  for (const StateMatrix& block : own_) sum += block.diagonal().array().log().sum();
  return 2 * sum;
}

}  // namespace dqslam::tracks
