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

/// The objects of a stage at some values, by slot.
struct UnpackedObjects {
  UnpackedObjects(const StageTerms& terms, const Eigen::VectorXd& values) {
    const VariableIndex& variables = terms.variables;
    ellipsoids.reserve(variables.num_objects());
    if (!terms.shapes.empty()) bodies.resize(variables.num_objects());
    for (const int object : variables.objects) {
      const double* parameters = &values[variables.Start(ObjectRow{object})];
      ellipsoids.emplace_back(parameters);
      const Shape shape = ShapeOf(terms.shapes, object);
      if (shape != Shape::kEllipsoid) {
        bodies[variables.slot_of_object[object]] =
            Unpacked<BodyModel>(RoundedModel(shape), parameters);
      }
    }
  }

  std::vector<Unpacked<EllipsoidModel>> ellipsoids;
  std::vector<Unpacked<BodyModel>> bodies;  ///< empty if there are none
};

/// What linearization needs of a stage.
struct LinearizedStage {
  const PreparedGraph& prepared;
  const StageTerms& terms;
  const ceres::LossFunction* loss;  ///< of whole boxes; null for least squares
  /// The blocks of H to which the terms of two blocks add, in the order of these terms.
  const std::vector<int>& off_diagonal;
};

/// A visitor that adds up terms at some values, with or without derivatives.
template <typename Pose, bool kDerivatives>
class Linearizer {
 public:
  /// Visits boxes of the poses from `first_pose` to before `end_pose`.  `equations` is null without
  /// derivatives.
  Linearizer(const LinearizedStage& stage,
             const Eigen::VectorXd& values,
             const UnpackedObjects& objects,
             int first_pose,
             int end_pose,
             Accumulator* equations)
      : prepared_(stage.prepared),
        variables_(stage.terms.variables),
        loss_(stage.loss),
        off_diagonals_(stage.off_diagonal),
        off_diagonal_(off_diagonals_.data()),
        values_(values),
        objects_(objects),
        first_pose_(first_pose),
        equations_(equations) {
    stations_.reserve(end_pose - first_pose);
    for (int pose = first_pose; pose < end_pose; ++pose) {
      stations_.push_back(Station::At<Pose>(ParametersOf(PoseRow{pose}).values, prepared_.mount));
    }
  }

  /// Says that the next term of two blocks is that of this number among them.
  void Skip(size_t number) { off_diagonal_ = off_diagonals_.data() + number; }

  /// Half the sum of the squared residuals so far, after the loss.
  double cost() const { return cost_; }
  void AddCost(double cost) { cost_ += cost; }

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
      const Station& station = stations_[pose - first_pose_];
      return LinearizeBox<Pose, kDerivatives>(
          prepared_, box, station, landmark, &residual, &by_pose, &by_object);
    };
    if (!(box.shape == Shape::kEllipsoid ? linearize(objects_.ellipsoids[slot])
                                         : linearize(objects_.bodies[slot]))) {
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
  const std::vector<int>& off_diagonals_;
  const int* off_diagonal_;  // of the next term of two blocks
  const Eigen::VectorXd& values_;
  const UnpackedObjects& objects_;
  int first_pose_;
  Accumulator* equations_;
  std::vector<Station> stations_;  // from first_pose_ on
  double cost_ = 0;
};

}  // namespace dqslam
