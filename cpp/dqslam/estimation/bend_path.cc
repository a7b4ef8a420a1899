#include "dqslam/estimation/bend_path.h"

#include <Eigen/Cholesky>

namespace dqslam {
namespace {

constexpr int kIterations = 5;  // of Gauss-Newton

}  // namespace

template <typename Pose>
void BendPath(
    const std::vector<Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>>& covariances,
    const Eigen::Matrix<double, Pose::kSize, 1>& target,
    RowMatrix* poses) {
  constexpr int k = Pose::kTangentSize;
  using Storage = Eigen::Matrix<double, Pose::kSize, 1>;
  using Square = Eigen::Matrix<double, k, k>;
  using Column = Eigen::Matrix<double, k, 1>;
  const Eigen::Index last = poses->rows() - 1;
  std::vector<Square> gain(covariances.size());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double* reached = poses->row(last).data();
    Square total = Square::Zero();
    for (Eigen::Index pose = 1; pose <= last; ++pose) {
      Storage between;
      Pose::Between(reached, poses->row(pose).data(), between.data());
      const Square J = Adjoint<Pose>(between.data());
      gain[pose - 1] = covariances[pose - 1] * J.transpose();
      total += J * gain[pose - 1];
    }
    Column missing;
    Minus<Pose>(target.data(), reached, missing.data());
    const Column multiplier = total.ldlt().solve(missing);
    Storage old = poses->row(0).transpose();
    for (Eigen::Index pose = 1; pose <= last; ++pose) {
      Storage step, moved;
      Pose::Between(old.data(), poses->row(pose).data(), step.data());
      old = poses->row(pose).transpose();
      const Column change = gain[pose - 1] * multiplier;
      Plus<Pose>(step.data(), change.data(), moved.data());
      double* result = poses->row(pose).data();
      Pose::Compose(poses->row(pose - 1).data(), moved.data(), result);
      Pose::Normalize(result);
    }
  }
  poses->row(last) = target.transpose();
}

template <typename Pose>
Surface<double> MoveWith(const double* before,
                         const double* after,
                         const Surface<double>& surface) {
  const Rigid<double> from = Pose::template WorldFromRobot<double>(before);
  const Rigid<double> to = Pose::template WorldFromRobot<double>(after);
  const Eigen::Matrix3d turn = to.rotation * from.rotation.transpose();
  Surface<double> moved = surface;
  moved.center = turn * (surface.center - from.translation) + to.translation;
  moved.shape = turn * surface.shape * turn.transpose();
  return moved;
}

template void BendPath<Se2>(const std::vector<Eigen::Matrix3d>&,
                            const Eigen::Matrix<double, 3, 1>&,
                            RowMatrix*);
template void BendPath<Se3>(const std::vector<Eigen::Matrix<double, 6, 6>>&,
                            const Eigen::Matrix<double, 7, 1>&,
                            RowMatrix*);
template Surface<double> MoveWith<Se2>(const double*, const double*, const Surface<double>&);
template Surface<double> MoveWith<Se3>(const double*, const double*, const Surface<double>&);

}  // namespace dqslam
