// The one enumeration of the terms of a stage: each cost, and the poses and objects that it is
// between.  The native normal equations, Ceres and the covariances visit it.  Sessions share its
// priors and its kinds of measurements.
//
// A visitor has two methods, both of which return false to stop:
//   Visit(cost, blocks...)   gets a functor of costs/, and a PoseRow, an ObjectRow or a SharedRow
//                            for each block.
//   VisitBox(box)            gets a StageBox; VisitBoxCost() gives its cost.
#pragma once

#include <utility>

#include "dqslam/costs/algebraic.h"
#include "dqslam/costs/body_priors.h"
#include "dqslam/costs/box.h"
#include "dqslam/costs/measurements.h"
#include "dqslam/costs/odometry.h"
#include "dqslam/costs/placements.h"
#include "dqslam/costs/scene_priors.h"
#include "dqslam/costs/shared.h"
#include "dqslam/costs/size_prior.h"
#include "dqslam/costs/tangent.h"
#include "dqslam/geometry/body.h"
#include "dqslam/geometry/jets.h"
#include "dqslam/solver/stage_terms.h"

namespace dqslam {

/// The parameters of a block, for Differentiate().
template <typename Pose>
PoseParameters<Pose> ParametersOf(PoseRow, const double* values) {
  return {values};
}
template <typename Pose>
ObjectParameters ParametersOf(ObjectRow, const double* values) {
  return {values};
}
template <typename Pose>
SharedParameters ParametersOf(SharedRow, const double* values) {
  return {values};
}

/// The cost of a box with one of the algebraic residuals.
template <typename Pose, typename Landmark>
AlgebraicCost<Pose, Landmark> MakeAlgebraicCost(const SolveContext& context, const StageBox& box) {
  return {{},
          context.prepared.mount,
          BoxLines(context.graph().camera, context.graph().boxes.box.row(box.row)),
          Eigen::Matrix4d::Identity() / context.options.algebraic_sigma,
          box.residual.residual == Residual::kAlgebraicNormalized};
}

/// Calls visit(cost) with the cost of a box, and returns the result of the call.
template <typename Pose, typename Landmark, typename Visit>
auto VisitBoxCost(const SolveContext& context, const StageBox& box, Visit&& visit) {
  const Camera& camera = context.graph().camera;
  const Mount& mount = context.prepared.mount;
  const Eigen::Vector4d observed = context.graph().boxes.box.row(box.row);
  const Eigen::Matrix4d& sqrt_information = context.prepared.box_sqrt_information[box.row];
  const BoxResidual& role = box.residual;
  if (IsAlgebraic(role.residual)) return visit(MakeAlgebraicCost<Pose, Landmark>(context, box));
  const auto visit_edges = [&](auto model) {
    using Model = decltype(model);
    if (role.residual == Residual::kBox) {
      return visit(BoxCost<Pose, Model>{
          {}, camera, mount, observed, sqrt_information, role.one_sided, model});
    }
    return visit(TangentCost<Pose, Model>{
        {}, camera, mount, observed, sqrt_information, role.depth, role.one_sided, model});
  };
  if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
    if (box.shape != Shape::kEllipsoid) return visit_edges(RoundedModel(box.shape));
  }
  return visit_edges(Landmark{});
}

/// Calls visit(cost) with each prior on an ellipsoid.  Returns false where a call returns false.
template <typename Visit>
bool VisitObjectPriors(double log_size_mean,
                       double log_size_sigma,
                       const ScenePriors& scene,
                       Visit&& visit) {
  if (!visit(SizePriorCost{{}, log_size_mean, log_size_sigma})) return false;
  if (scene.upright_sigma > 0 && !visit(UprightCost{{}, scene.up, scene.upright_sigma})) {
    return false;
  }
  return scene.support_sigma == 0 ||
         visit(SupportPlaneCost{{}, scene.up, scene.plane_offset, scene.support_sigma});
}

/// The same for a cuboid or a cylinder, and that it stands upright.  A tilt moves its lowest point
/// down whichever way it leans, so that free tilts would all grow with the noise of boxes, and the
/// bodies with them.  In space the vertical is hardly known, and a body may lie in any way.
template <typename Visit>
bool VisitBodyPriors(Shape shape,
                     double log_size_mean,
                     double log_size_sigma,
                     const ScenePriors& scene,
                     bool on_plane,
                     Visit&& visit) {
  constexpr double kOnPlane = 0.02, kInSpace = 1;  // radians
  if (!visit(BodySizeCost{{}, log_size_mean, log_size_sigma})) return false;
  if (shape == Shape::kCylinder && !visit(RoundCost{})) return false;
  const bool may_lie = on_plane && scene.upright_sigma == 0;
  const double usual = on_plane ? kOnPlane : kInSpace;
  const double sigma = scene.upright_sigma > 0 ? scene.upright_sigma : usual;
  const BodyUprightCost upright{{}, shape, scene.up, sigma};
  if (!(may_lie ? visit(BodyStandsCost{{}, upright}) : visit(upright))) return false;
  return scene.support_sigma == 0 ||
         visit(BodySupportCost{{}, shape, scene.up, scene.plane_offset, scene.support_sigma});
}

/// Calls visit(cost) with each prior on a pose.  Returns false where a call returns false.
template <typename Pose, typename Visit>
bool VisitPosePriors(const Mount& mount, const ScenePriors& scene, Visit&& visit) {
  return scene.camera_height_sigma == 0 || visit(CameraHeightCost<Pose>{{},
                                                                        mount,
                                                                        scene.up,
                                                                        scene.plane_offset,
                                                                        scene.camera_height,
                                                                        scene.camera_height_sigma});
}

/// Calls visit with the model of an object, an EllipsoidModel or a BodyModel.
template <typename Visit>
bool VisitModel(Shape shape, Visit&& visit) {
  return shape == Shape::kEllipsoid ? visit(EllipsoidModel()) : visit(RoundedModel(shape));
}

/// Visits the placements of the objects in a stage.  Returns false where a visit returned false.
template <typename Visitor>
bool VisitPlacements(const Graph& graph, const StageTerms& terms, Visitor* visitor) {
  const PlacementTable& table = graph.placements;
  const Eigen::Vector3d& up = graph.scene_priors.up;
  const std::vector<int>& slots = terms.variables.slot_of_object;
  for (int row = 0; row < table.size(); ++row) {
    const ObjectRow object{table.object[row]}, other{table.other[row]};
    if (slots[object.row] < 0 || (other.row >= 0 && slots[other.row] < 0)) continue;
    const double distance = table.distance[row], sigma = table.sigma[row];
    const Placement kind = table.kind[row];
    const bool defined = VisitModel(ShapeOf(terms.shapes, object.row), [&](auto model) {
      using Model = decltype(model);
      if (kind == Placement::kUpright) {
        return visitor->Visit(PlumbCost<Model>{{}, model, up, sigma}, object);
      }
      if (other.row < 0) {
        const OnPlaneCost<Model> cost{{}, model, up, distance, sigma};
        return visitor->Visit(cost, object, SharedRow{table.shared[row]});
      }
      return VisitModel(ShapeOf(terms.shapes, other.row), [&](auto other_model) {
        using Other = decltype(other_model);
        if (kind == Placement::kOn) {
          const OnObjectCost<Model, Other> cost{{}, model, other_model, up, sigma};
          return visitor->Visit(cost, object, other);
        }
        if (kind == Placement::kAligned) {
          const AlignedCost<Model, Other> cost{{}, model, other_model, up, sigma};
          return visitor->Visit(cost, object, other);
        }
        const BesideCost<Model, Other> cost{{}, model, other_model, up, distance, sigma};
        return visitor->Visit(cost, object, other);
      });
    });
    if (!defined) return false;
  }
  return true;
}

/// Visits some odometry.  Returns false where a visit returned false.
template <typename Pose, typename Visitor>
bool VisitOdometry(const PreparedGraph& prepared,
                   const StageTerms& terms,
                   TermRange range,
                   Visitor* visitor) {
  const OdometryTable& odometry = prepared.graph.odometry;
  for (size_t i = range.begin; i < range.end; ++i) {
    const int row = terms.odometry[i];
    using Square = Eigen::Matrix<double, Pose::kTangentSize, Pose::kTangentSize>;
    const OdometryCost<Pose> cost{{},
                                  odometry.relative.row(row).transpose(),
                                  Square(prepared.odometry_sqrt_information[row])};
    const PoseRow from{odometry.from[row]}, to{odometry.to[row]};
    if (!visitor->Visit(cost, from, to)) return false;
  }
  return true;
}

/// Visits some boxes.  Returns false where a visit returned false.
template <typename Visitor>
bool VisitBoxes(const StageTerms& terms, TermRange range, Visitor* visitor) {
  for (size_t i = range.begin; i < range.end; ++i) {
    if (!visitor->VisitBox(terms.boxes[i])) return false;
  }
  return true;
}

/// Visits all terms but odometry and boxes.  Returns false where a visit returned false.
template <typename Pose, typename Landmark, typename Visitor>
bool VisitOtherTerms(const PreparedGraph& prepared, const StageTerms& terms, Visitor* visitor) {
  const Graph& graph = prepared.graph;
  for (size_t t = 0; t < terms.measurements.size(); ++t) {
    const MeasurementTable& table = graph.measurements[t];
    const bool defined =
        VisitMeasurementKind<Pose, Landmark>(prepared.measurement_kinds[t], [&](auto tag) {
          for (const int row : terms.measurements[t]) {
            const auto cost = MakeMeasurementCost<typename decltype(tag)::Cost>(
                table.value.row(row).data(),
                prepared.measurement_sqrt_information[t].row(row).data());
            const PoseRow pose{table.pose[row]};
            const ObjectRow object{table.object[row]};
            if (!visitor->Visit(cost, pose, object)) return false;
          }
          return true;
        });
    if (!defined) return false;
  }
  if constexpr (Landmark::kModel == LandmarkModel::kEllipsoid) {
    constexpr bool kOnPlane = Pose::kModel == PoseModel::kSe2;
    for (const int object : terms.variables.objects) {
      const double mean = graph.size_prior.log_mean[object];
      const double sigma = graph.size_prior.log_sigma[object];
      const Shape shape = ShapeOf(terms.shapes, object);
      const int shared = SharedOf(graph.size_prior.shared, object);
      const auto visit = [&](const auto& cost) {
        using Cost = std::decay_t<decltype(cost)>;
        if constexpr (kIsSizePrior<Cost>) {
          if (shared >= 0) {
            const SharedMedianCost<Cost> with_shared{{}, cost};
            return visitor->Visit(with_shared, ObjectRow{object}, SharedRow{shared});
          }
        }
        return visitor->Visit(cost, ObjectRow{object});
      };
      const bool defined =
          shape == Shape::kEllipsoid
              ? VisitObjectPriors(mean, sigma, graph.scene_priors, visit)
              : VisitBodyPriors(shape, mean, sigma, graph.scene_priors, kOnPlane, visit);
      if (!defined) return false;
    }
    if (!VisitPlacements(graph, terms, visitor)) return false;
  }
  for (int row = 0; row < graph.num_shared(); ++row) {
    if (!visitor->Visit(SharedPriorCost{{}, graph.shared_sigma[row]}, SharedRow{row})) return false;
  }
  return VisitPosePriors<Pose>(prepared.mount, graph.scene_priors, [&](const auto& cost) {
    for (int pose = terms.variables.first_free_pose; pose < terms.variables.end_pose; ++pose) {
      if (!visitor->Visit(cost, PoseRow{pose})) return false;
    }
    return true;
  });
}

/// Visits all terms: odometry, boxes, then the others.  Returns false where a visit returned false.
template <typename Pose, typename Landmark, typename Visitor>
bool VisitTerms(const PreparedGraph& prepared, const StageTerms& terms, Visitor* visitor) {
  return VisitOdometry<Pose>(prepared, terms, terms.all_odometry(), visitor) &&
         VisitBoxes(terms, terms.all_boxes(), visitor) &&
         VisitOtherTerms<Pose, Landmark>(prepared, terms, visitor);
}

}  // namespace dqslam
