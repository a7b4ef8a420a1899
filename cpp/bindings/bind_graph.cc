#include <pybind11/eigen.h>
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include <optional>
#include <utility>
#include <vector>

#include "bindings.h"
#include "dqslam/problem/graph.h"
#include "keywords.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {
namespace {

void BindTables(py::module_& m) {
  py::class_<OdometryTable>(m, "OdometryTable", "Relative poses between poses. Immutable.")
      .def(py::init<IndexVector, IndexVector, RowMatrix, RowMatrix>(),
           py::kw_only(),
           "from_pose"_a,
           "to_pose"_a,
           "relative"_a,
           "covariance"_a,
           "With d the size of a pose and k of its tangent.")
      .def_readonly("from_pose", &OdometryTable::from, "Shape (m,).")
      .def_readonly("to_pose", &OdometryTable::to, "Shape (m,).")
      .def_readonly("relative", &OdometryTable::relative, "to_in_from, shape (m, d).")
      .def_readonly("covariance", &OdometryTable::covariance, "Shape (m, k * k).");
  py::class_<BoxTable>(m, "BoxTable", "Boxes whose object is known. Immutable.")
      .def(py::init<IndexVector, IndexVector, RowMatrix, RowMatrix, BoolTable>(),
           py::kw_only(),
           "pose"_a,
           "object"_a,
           "box"_a,
           "covariance"_a,
           "truncated"_a)
      .def_readonly("pose", &BoxTable::pose, "Shape (b,).")
      .def_readonly("object", &BoxTable::object, "Shape (b,).")
      .def_readonly("box", &BoxTable::box, "Undistorted pixels, shape (b, 4).")
      .def_readonly("covariance", &BoxTable::covariance, "Pixels squared, shape (b, 16).")
      .def_readonly("truncated", &BoxTable::truncated, "Edges cut by the image border, (b, 4).");
  py::class_<MeasurementTable>(
      m, "MeasurementTable", "Measurements of one kind between poses and objects. Immutable.")
      .def(py::init<std::string, IndexVector, IndexVector, RowMatrix, RowMatrix>(),
           py::kw_only(),
           "kind"_a,
           "pose"_a,
           "object"_a,
           "value"_a,
           "covariance"_a)
      .def_readonly("kind", &MeasurementTable::kind, "\"position\" or \"range\".")
      .def_readonly("pose", &MeasurementTable::pose, "Shape (n,).")
      .def_readonly("object", &MeasurementTable::object, "Shape (n,).")
      .def_readonly("value", &MeasurementTable::value, "What was measured, shape (n, m).")
      .def_readonly("covariance", &MeasurementTable::covariance, "Shape (n, m * m).");
  py::class_<SizePriorTable>(m, "SizePriorTable", "Prior on the size of each object. Immutable.")
      .def(py::init<Eigen::VectorXd, Eigen::VectorXd, IndexVector>(),
           py::kw_only(),
           "log_mean"_a,
           "log_sigma"_a,
           "shared"_a = IndexVector())
      .def_readonly("log_mean", &SizePriorTable::log_mean, "Of semi-axes, log meters, shape (o,).")
      .def_readonly("log_sigma", &SizePriorTable::log_sigma, "Shape (o,).")
      .def_readonly("shared",
                    &SizePriorTable::shared,
                    "The shared number that is added to each log_mean, or -1; shape (o,) or (0,).");
}

void BindPlacements(py::module_& m) {
  py::native_enum<Placement>(m, "Placement", "enum.Enum", "How an object is placed.")
      .value("ON", Placement::kOn)
      .value("BESIDE", Placement::kBeside)
      .value("ALIGNED", Placement::kAligned)
      .value("UPRIGHT", Placement::kUpright)
      .finalize();
  py::class_<PlacementTable>(
      m, "PlacementTable", "How objects are placed; each row may be wrong. Immutable.")
      .def(py::init<std::vector<Placement>,
                    IndexVector,
                    IndexVector,
                    IndexVector,
                    Eigen::VectorXd,
                    Eigen::VectorXd>(),
           py::kw_only(),
           "kind"_a,
           "object"_a,
           "other"_a,
           "shared"_a,
           "distance"_a,
           "sigma"_a)
      .def_readonly("kind", &PlacementTable::kind)
      .def_readonly("object", &PlacementTable::object, "Shape (p,).")
      .def_readonly("other", &PlacementTable::other, "Another object, or -1, shape (p,).")
      .def_readonly("shared",
                    &PlacementTable::shared,
                    "The shared number that is added to the height of a plane, or -1, shape (p,).")
      .def_readonly("distance",
                    &PlacementTable::distance,
                    "Meters: height of the plane, or largest horizontal distance, shape (p,).")
      .def_readonly("sigma", &PlacementTable::sigma, "Meters or radians, shape (p,).");
}

void BindScenePriors(py::module_& m) {
  py::class_<ScenePriors>(
      m, "ScenePriors", "What is known of the scene; each part is off while its sigma is 0.")
      .def(py::init(&FromKeywords<ScenePriors>), "Any of the attributes as keywords.")
      .def("__repr__", &ShowChanges<ScenePriors>)
      .def_readwrite("up", &ScenePriors::up, "Unit normal n of the ground, in the world, (3,).")
      .def_readwrite(
          "plane_offset", &ScenePriors::plane_offset, "d of the ground n.x + d = 0, meters.")
      .def_readwrite("upright_sigma",
                     &ScenePriors::upright_sigma,
                     "A principal axis of each object is vertical: radians.")
      .def_readwrite(
          "support_sigma", &ScenePriors::support_sigma, "Each object stands on the ground: meters.")
      .def_readwrite("camera_height", &ScenePriors::camera_height, "Meters above the ground.")
      .def_readwrite("camera_height_sigma", &ScenePriors::camera_height_sigma, "Meters.");
}

}  // namespace

void BindGraph(py::module_& m) {
  BindTables(m);
  BindScenePriors(m);
  BindPlacements(m);
  py::class_<Graph>(m, "Graph", "The problem as plain tables; ids are row numbers. Immutable.")
      .def(py::init([](PoseModel pose_model,
                       const Camera& camera,
                       RowMatrix initial_poses,
                       OdometryTable odometry,
                       BoxTable boxes,
                       SizePriorTable size_prior,
                       std::vector<MeasurementTable> measurements,
                       const ScenePriors& scene_priors,
                       std::vector<Shape> shapes,
                       Eigen::VectorXd shared_sigma,
                       std::optional<PlacementTable> placements) {
             Graph graph{pose_model,
                         camera,
                         initial_poses,
                         odometry,
                         boxes,
                         measurements,
                         size_prior,
                         scene_priors,
                         std::move(shapes),
                         std::move(shared_sigma),
                         placements.value_or(PlacementTable())};
             Validate(graph, /*poses_known=*/true);  // solve() asks for odometry where it needs it
             return graph;
           }),
           "pose_model"_a,
           "camera"_a,
           py::kw_only(),
           "initial_poses"_a,
           "odometry"_a,
           "boxes"_a,
           "size_prior"_a,
           "measurements"_a = std::vector<MeasurementTable>(),
           "scene_priors"_a = ScenePriors(),
           "shapes"_a = std::vector<Shape>(),
           "shared_sigma"_a = Eigen::VectorXd(),
           "placements"_a = std::nullopt,
           "initial_poses (n, d): dead reckoning, or the known poses when mapping.")
      .def_readonly("pose_model", &Graph::pose_model)
      .def_readonly("camera", &Graph::camera)
      .def_readonly("initial_poses", &Graph::initial_poses, "Shape (n, d).")
      .def_readonly("odometry", &Graph::odometry)
      .def_readonly("boxes", &Graph::boxes)
      .def_readonly("size_prior", &Graph::size_prior)
      .def_readonly("measurements", &Graph::measurements, "One table a kind.")
      .def_readonly("scene_priors", &Graph::scene_priors)
      .def_readonly("shapes", &Graph::shapes, "One an object; empty if all are ellipsoids.")
      .def_readonly("shared_sigma",
                    &Graph::shared_sigma,
                    "Sigmas of the numbers that priors have in common, shape (s,).")
      .def_readonly("placements", &Graph::placements)
      .def_property_readonly("num_poses", &Graph::num_poses)
      .def_property_readonly("num_objects", &Graph::num_objects);
}

}  // namespace dqslam
