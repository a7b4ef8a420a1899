// Residuals and derivatives of the terms of a stage, added up into normal equations.
//
// Boxes are nine tenths of all terms and have derivatives written by hand
// (geometry/box_derivatives.h).  All other costs are differentiated by AutoDiff on jets
// (geometry/jets.h).
#pragma once

#include <ceres/loss_function.h>

#include <cmath>
#include <type_traits>
#include <vector>

#include "dqslam/geometry/body_derivatives.h"
#include "dqslam/geometry/jets.h"
#include "dqslam/linear/normal_equations.h"
#include "dqslam/solver/terms.h"

namespace dqslam {

template <int kRows, int kColumns>
using Matrix = Eigen::Matrix<double, kRows, kColumns>;

/// Computes the box or tangent residual of a box, in sigmas, and its Jacobians.  Without
/// kDerivatives the Jacobians are left unchanged.  Returns false where the residual is undefined.
template <typename Pose, bool kDerivatives, typename Landmark>
bool LinearizeBox(const PreparedGraph& prepared,
                  const StageBox& box,
                  const Station& station,
                  const Unpacked<Landmark>& landmark,
                  Eigen::Vector4d* residual,
                  Matrix<kBoxSize, Pose::kTangentSize>* by_pose,
                  Matrix<kBoxSize, kLandmarkSize>* by_object) {
  const Eigen::Vector4d observed = prepared.graph.boxes.box.row(box.row).transpose();
  Eigen::Vector4d error;
  std::conditional_t<std::is_same_v<Landmark, BodyModel>, BodyEdgeDerivatives, EdgeDerivatives>
      edges;
  if (!EdgeErrors<kDerivatives>(ToCamera(station.camera, landmark.surface),
                                prepared.graph.camera,
                                observed,
                                box.residual.depth,
                                box.residual.one_sided,
                                &error,
                                &edges)) {
    return false;
  }
  const Eigen::Matrix4d& whiten = prepared.box_sqrt_information[box.row];
  residual->noalias() = whiten * error;
  if constexpr (kDerivatives) {
    Matrix<kBoxSize, Pose::kTangentSize> J_pose;
    Matrix<kBoxSize, kLandmarkSize> J_object;
    ByPoseAndLandmark<Pose>(edges, station, prepared.mount, landmark, &J_pose, &J_object);
    by_pose->noalias() = whiten * J_pose;
    by_object->noalias() = whiten * J_object;
  }
  return true;
}

/// A visitor that adds up the terms at some values, with or without derivatives.
template <typename Pose, bool kDerivatives>
class Linearizer {
 public:
  /// `loss` applies to whole boxes and is null for least squares.  `off_diagonal` lists the blocks
  /// of H to which the terms of two blocks add, in the order of these terms.  `equations` is null
  /// without derivatives.
  Linearizer(const PreparedGraph& prepared,
             const StageTerms& terms,
             const ceres::LossFunction* loss,
             const std::vector<int>& off_diagonal,
             const Eigen::VectorXd& values,
             Accumulator* equations)
      : prepared_(prepared),
        variables_(terms.variables),
        loss_(loss),
        off_diagonal_(off_diagonal.data()),
        values_(values),
        equations_(equations) {
    stations_.reserve(variables_.num_poses());
    for (int pose = variables_.first_pose; pose < variables_.end_pose; ++pose) {
      stations_.push_back(Station::At<Pose>(ParametersOf(PoseRow{pose}).values, prepared.mount));
    }
    ellipsoids_.reserve(variables_.num_objects());
    if (!terms.shapes.empty()) bodies_.resize(variables_.num_objects());
    for (const int object : variables_.objects) {
      const double* parameters = ParametersOf(ObjectRow{object}).values;
      ellipsoids_.emplace_back(parameters);
      const Shape shape = ShapeOf(terms.shapes, object);
      if (shape != Shape::kEllipsoid) {
        bodies_[variables_.slot_of_object[object]] =
            Unpacked<BodyModel>(RoundedModel(shape), parameters);
      }
    }
  }

  /// Half the sum of the squared residuals so far, after the loss.
  double cost() const { return cost_; }

  template <typename Cost, typename... Rows>
  bool Visit(const Cost& cost, const Rows&... rows) {
    constexpr int m = Cost::kResidualSize;
    Matrix<m, 1> residual;
    if constexpr (kDerivatives) {
      Matrix<m, (kTangentOf<Pose, Rows> + ...)> jacobian;
      if (!Differentiate(cost, &residual, &jacobian, ParametersOf(rows)...)) return false;
      Add(residual, jacobian, rows...);
    } else {
      if (!cost(ParametersOf(rows).values..., residual.data())) return false;
    }
    cost_ += 0.5 * residual.squaredNorm();
    return true;
  }

  bool VisitBox(const StageBox& box) {
    const int pose = prepared_.graph.boxes.pose[box.row];
    const int object = prepared_.graph.boxes.object[box.row];
    const int slot = variables_.slot_of_object[object];
    Eigen::Vector4d residual;
    Matrix<kBoxSize, kTangent> by_pose;
    Matrix<kBoxSize, kLandmarkSize> by_object;
    const auto linearize = [&](const auto& landmark) {
      const Station& station = stations_[pose - variables_.first_pose];
      return LinearizeBox<Pose, kDerivatives>(
          prepared_, box, station, landmark, &residual, &by_pose, &by_object);
    };
    if (!(box.shape == Shape::kEllipsoid ? linearize(ellipsoids_[slot])
                                         : linearize(bodies_[slot]))) {
      return false;
    }
    double rho[3] = {residual.squaredNorm(), 1, 0};
    if (loss_) loss_->Evaluate(rho[0], rho);
    cost_ += 0.5 * box.weight * rho[0];
    if constexpr (kDerivatives) {
      const double scale = box.weight * rho[1];
      if (scale != 1) {
        const double root = std::sqrt(scale);
        residual *= root;
        by_pose *= root;
        by_object *= root;
      }
      equations_->AddDiagonal(variables_.Block(PoseRow{pose}), by_pose, residual);
      equations_->AddDiagonal(variables_.Block(ObjectRow{object}), by_object, residual);
      equations_->AddOffDiagonal(*off_diagonal_++, by_pose, by_object);
    }
    return true;
  }

 private:
  static constexpr int kTangent = Pose::kTangentSize;
  template <typename Row>
  auto ParametersOf(Row row) const {
    return dqslam::ParametersOf<Pose>(row, &values_[variables_.Start(row)]);
  }

  template <int m, typename Row>
  void Add(const Matrix<m, 1>& residual,
           const Matrix<m, kTangentOf<Pose, Row>>& jacobian,
           Row row) {
    equations_->AddDiagonal(variables_.Block(row), jacobian, residual);
  }

  template <int m, int kColumns, typename A, typename B>
  void Add(const Matrix<m, 1>& residual, const Matrix<m, kColumns>& jacobian, A a, B b) {
    const Matrix<m, kTangentOf<Pose, A>> by_a = jacobian.template leftCols<kTangentOf<Pose, A>>();
    const Matrix<m, kTangentOf<Pose, B>> by_b = jacobian.template rightCols<kTangentOf<Pose, B>>();
    equations_->AddDiagonal(variables_.Block(a), by_a, residual);
    equations_->AddDiagonal(variables_.Block(b), by_b, residual);
    if (variables_.Block(a) < variables_.Block(b)) {
      equations_->AddOffDiagonal(*off_diagonal_++, by_a, by_b);
    } else {
      equations_->AddOffDiagonal(*off_diagonal_++, by_b, by_a);
    }
  }

  const PreparedGraph& prepared_;
  const VariableIndex& variables_;
  const ceres::LossFunction* loss_;
  const int* off_diagonal_;  // of the next term of two blocks
  const Eigen::VectorXd& values_;
  Accumulator* equations_;
  std::vector<Station> stations_;                     // of all poses
  std::vector<Unpacked<EllipsoidModel>> ellipsoids_;  // by slot
  std::vector<Unpacked<BodyModel>> bodies_;           // by slot; empty if there are none
  double cost_ = 0;
};

}  // namespace dqslam
