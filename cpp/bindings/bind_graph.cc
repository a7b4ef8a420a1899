#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings.h"
#include "dqslam/problem/graph.h"
#include "keywords.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {

void BindGraph(py::module_& m) {
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
  py::class_<Graph>(m, "Graph", "The problem as plain tables; ids are row numbers. Immutable.")
      .def(py::init([](PoseModel pose_model,
                       const Camera& camera,
                       RowMatrix initial_poses,
                       IndexVector odometry_from,
                       IndexVector odometry_to,
                       RowMatrix odometry,
                       RowMatrix odometry_covariance,
                       IndexVector box_pose,
                       IndexVector box_object,
                       RowMatrix boxes,
                       RowMatrix box_covariance,
                       std::optional<BoolTable> box_truncated,
                       IndexVector position_pose,
                       IndexVector position_object,
                       RowMatrix positions,
                       RowMatrix position_covariance,
                       Eigen::VectorXd log_size_mean,
                       Eigen::VectorXd log_size_sigma,
                       const ScenePriors& scene_priors) {
             const BoolTable none = BoolTable::Constant(boxes.rows(), kBoxSize, false);
             Graph graph{
                 pose_model,
                 camera,
                 std::move(initial_poses),
                 {odometry_from, odometry_to, odometry, odometry_covariance},
                 {box_pose, box_object, boxes, box_covariance, box_truncated.value_or(none)},
                 {position_pose, position_object, positions, position_covariance},
                 {log_size_mean, log_size_sigma},
                 scene_priors};
             Validate(graph, /*poses_known=*/true);  // solve() asks for odometry where it needs it
             return graph;
           }),
           "pose_model"_a,
           "camera"_a,
           py::kw_only(),
           "initial_poses"_a,
           "odometry_from"_a,
           "odometry_to"_a,
           "odometry"_a,
           "odometry_covariance"_a,
           "box_pose"_a,
           "box_object"_a,
           "boxes"_a,
           "box_covariance"_a,
           "box_truncated"_a = std::nullopt,
           "position_pose"_a = IndexVector(),
           "position_object"_a = IndexVector(),
           "positions"_a = RowMatrix(0, 3),
           "position_covariance"_a = RowMatrix(0, 9),
           "log_size_mean"_a,
           "log_size_sigma"_a,
           "scene_priors"_a = ScenePriors(),
           "Shapes, with d the size of a pose and k of its tangent: initial_poses (n, d); odometry "
           "(m, d), to_in_from, with covariance (m, k * k); boxes (b, 4) undistorted pixels with "
           "covariance (b, 16) and box_truncated (b, 4), edges cut by the image border; positions "
           "(p, 3) object_in_robot, meters, with covariance (p, 9); "
           "log_size_mean and log_size_sigma (o,), of semi-axes in log meters.")
      .def_readonly("pose_model", &Graph::pose_model)
      .def_readonly("camera", &Graph::camera)
      .def_readonly("initial_poses", &Graph::initial_poses, "Shape (n, d).")
      .def_property_readonly("odometry_from", [](const Graph& g) { return g.odometry.from; })
      .def_property_readonly("odometry_to", [](const Graph& g) { return g.odometry.to; })
      .def_property_readonly("odometry", [](const Graph& g) { return g.odometry.relative; })
      .def_property_readonly("odometry_covariance",
                             [](const Graph& g) { return g.odometry.covariance; })
      .def_property_readonly("box_pose", [](const Graph& g) { return g.boxes.pose; })
      .def_property_readonly("box_object", [](const Graph& g) { return g.boxes.object; })
      .def_property_readonly("boxes", [](const Graph& g) { return g.boxes.box; })
      .def_property_readonly("box_covariance", [](const Graph& g) { return g.boxes.covariance; })
      .def_property_readonly("box_truncated", [](const Graph& g) { return g.boxes.truncated; })
      .def_property_readonly("position_pose", [](const Graph& g) { return g.positions.pose; })
      .def_property_readonly("position_object", [](const Graph& g) { return g.positions.object; })
      .def_property_readonly("positions",
                             [](const Graph& g) { return g.positions.object_in_robot; })
      .def_property_readonly("position_covariance",
                             [](const Graph& g) { return g.positions.covariance; })
      .def_property_readonly("log_size_mean", [](const Graph& g) { return g.size_prior.log_mean; })
      .def_property_readonly("log_size_sigma",
                             [](const Graph& g) { return g.size_prior.log_sigma; })
      .def_readonly("scene_priors", &Graph::scene_priors)
      .def_property_readonly("num_poses", &Graph::num_poses)
      .def_property_readonly("num_objects", &Graph::num_objects);
}

}  // namespace dqslam
