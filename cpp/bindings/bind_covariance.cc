#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings.h"
#include "dqslam/covariance.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {

void BindCovariance(py::module_& m) {
  py::class_<Covariance>(m, "Covariance", "Marginal covariances; the first pose is the gauge.")
      .def_readonly("poses",
                    &Covariance::poses,
                    "In the frames of the poses, shape (n, k * k); NaN where under-constrained.")
      .def_readonly("objects",
                    &Covariance::objects,
                    "Of the landmark parameters, shape (o, 81); NaN where under-constrained.")
      .def_readonly("under_constrained",
                    &Covariance::under_constrained,
                    "One sentence for each pose or object that nothing determines.");
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

  py::class_<OdometryFit>(m, "OdometryFit", "How well the odometry fits an estimate.")
      .def_readonly("residuals", &OdometryFit::residuals, "In sigmas, shape (n, k).")
      .def_readonly("leverage",
                    &OdometryFit::leverage,
                    "0..1, shape (n, k): 1 where the edge alone determines what it measures.");
  m.def("odometry_fit",
        &ComputeOdometryFit,
        "graph"_a,
        "options"_a,
        "state"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Residuals and leverage of the odometry: what variance components are estimated from.");
}

}  // namespace dqslam
