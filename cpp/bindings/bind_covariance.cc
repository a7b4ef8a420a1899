#include <pybind11/eigen.h>
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include "bindings.h"
#include "dqslam/estimation/covariance.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {

void BindCovariance(py::module_& m) {
  py::class_<UnderConstrained> under_constrained(
      m, "UnderConstrained", "A parameter that neither the data nor the priors determine.");
  py::native_enum<UnderConstrained::Kind>(under_constrained, "Kind", "enum.Enum")
      .value("POSE", UnderConstrained::Kind::kPose)
      .value("OBJECT", UnderConstrained::Kind::kObject)
      .finalize();
  under_constrained.def_readonly("kind", &UnderConstrained::kind)
      .def_readonly("row", &UnderConstrained::row, "Of the pose or the object in the graph.")
      .def_readonly("parameter", &UnderConstrained::parameter, "Of its tangent.");
  py::class_<Covariance>(m, "Covariance", "Marginal covariances; the first pose is the gauge.")
      .def_readonly("poses",
                    &Covariance::poses,
                    "In the frames of the poses, shape (n, k * k); NaN where under-constrained.")
      .def_readonly("objects",
                    &Covariance::objects,
                    "Of the landmark parameters, shape (o, 81); NaN where under-constrained.")
      .def_readonly("under_constrained",
                    &Covariance::under_constrained,
                    "The first such parameter of each pose and object.");
  m.def("covariance",
        &ComputeCovariance,
        "graph"_a,
        "options"_a,
        "state"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Marginal covariances at a state; at the true state, the posterior Cramer-Rao bound.");
  m.def("joint_covariance",
        &ComputeJointCovariance,
        "graph"_a,
        "options"_a,
        "state"_a,
        "poses"_a,
        "objects"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Joint covariance of some poses (k rows each), then objects (9 rows each).");

  py::class_<Fit>(m, "Fit", "How well measurements fit an estimate.")
      .def_readonly("odometry_residuals",
                    &Fit::odometry_residuals,
                    "In sigmas, shape (n, k), one row a step.")
      .def_readonly("odometry_leverage",
                    &Fit::odometry_leverage,
                    "0..1, shape (n, k): 1 where the step alone determines what it measures.")
      .def_readonly("box_squares", &Fit::box_squares, "Sum over all edges of boxes, in sigmas.")
      .def_readonly("box_redundancy", &Fit::box_redundancy, "Sum of 1 - leverage over them.");
  m.def("fit",
        &ComputeFit,
        "graph"_a,
        "options"_a,
        "state"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Residuals and leverage of odometry and boxes: what variance components come from.");
}

}  // namespace dqslam
