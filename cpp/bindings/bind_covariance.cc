#include <pybind11/eigen.h>
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include "bindings.h"
#include "dqslam/estimation/calibration.h"
#include "dqslam/estimation/covariance.h"
#include "dqslam/estimation/placement_misfits.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {

void BindCovariance(py::module_& m) {
  py::native_enum<VariableKind>(m, "VariableKind", "enum.Enum", "What a parameter belongs to.")
      .value("POSE", VariableKind::kPose)
      .value("OBJECT", VariableKind::kObject)
      .finalize();
  py::class_<UnderConstrained>(
      m, "UnderConstrained", "A parameter that neither the data nor the priors determine.")
      .def_readonly("kind", &UnderConstrained::kind, "Whether it belongs to a pose or an object.")
      .def_readonly("row", &UnderConstrained::row, "Row of the pose or the object in the graph.")
      .def_readonly(
          "parameter", &UnderConstrained::parameter, "Index of the parameter in its tangent.");
  py::class_<Covariance>(m, "Covariance", "Marginal covariances with the first pose fixed.")
      .def_readonly(
          "poses",
          &Covariance::poses,
          "Covariances in the frames of the poses, shape (n, k * k); NaN where under-constrained.")
      .def_readonly(
          "objects",
          &Covariance::objects,
          "Covariances of the landmark parameters, shape (o, 81); NaN where under-constrained.")
      .def_readonly("shared", &Covariance::shared, "Variances of the shared numbers, shape (s,).")
      .def_readonly("under_constrained",
                    &Covariance::under_constrained,
                    "The first under-constrained parameter of each pose and object that has one.");
  m.def("covariance",
        &ComputeCovariance,
        "graph"_a,
        "options"_a,
        "state"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Marginal covariances at a state. At the true state they are the posterior Cramer-Rao "
        "bound.");
  m.def("joint_covariance",
        &ComputeJointCovariance,
        "graph"_a,
        "options"_a,
        "state"_a,
        "poses"_a,
        "objects"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Joint covariance of some poses and objects: k rows for each pose, then 9 rows for each "
        "object.");
  m.def("placement_misfits",
        &PlacementMisfits,
        "graph"_a,
        "options"_a,
        "state"_a,
        "Residual norm of each placement at a state, in sigmas and before its switch, shape (p,).");

  py::class_<Fit>(m, "Fit", "How well measurements fit an estimate.")
      .def_readonly("odometry_residuals",
                    &Fit::odometry_residuals,
                    "Residuals in sigmas, shape (n, k), one row for each step.")
      .def_readonly(
          "odometry_leverage",
          &Fit::odometry_leverage,
          "Leverages from 0 to 1, shape (n, k); 1 where the step alone determines what it "
          "measures.")
      .def_readonly("box_squares",
                    &Fit::box_squares,
                    "Sum of the squared residuals of all edges of boxes, in sigmas.")
      .def_readonly(
          "box_redundancy", &Fit::box_redundancy, "Sum of 1 - leverage over all edges of boxes.");
  m.def("fit",
        &ComputeFit,
        "graph"_a,
        "options"_a,
        "state"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Residuals and leverage of odometry and boxes, from which variance components are "
        "estimated.");

  py::class_<CalibrationParameter>(
      m, "CalibrationParameter", "A deviation from what a graph takes for known.")
      .def_readonly("name", &CalibrationParameter::name, "What it is.")
      .def_readonly("unit", &CalibrationParameter::unit, "Its unit, empty for a share.");
  py::class_<CalibrationScore>(m, "CalibrationScore", "Score tests of the calibration.")
      .def_readonly("score", &CalibrationScore::score, "Scores, shape (p,).")
      .def_readonly("information", &CalibrationScore::information, "Information, shape (p, p).")
      .def_readonly("unchecked",
                    &CalibrationScore::unchecked,
                    "Information if all poses and objects were known, shape (p,).")
      .def_readonly("from_odometry",
                    &CalibrationScore::from_odometry,
                    "Covariance of the scores by the noise of odometry, shape (p, p).")
      .def_readonly("from_boxes",
                    &CalibrationScore::from_boxes,
                    "Covariance of the scores by the noise of boxes, shape (p, p).");
  m.def("calibration_parameters", &CalibrationParameters, "The parameters of score tests.");
  m.def("score_calibration",
        &ScoreCalibration,
        "graph"_a,
        "options"_a,
        "state"_a,
        "timestamps"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Score tests of camera, mount and odometry at an estimate.");
  m.def("recalibrate",
        &Recalibrate,
        "graph"_a,
        "state"_a,
        "timestamps"_a,
        "deviations"_a,
        py::call_guard<py::gil_scoped_release>(),
        "The graph with deviations of its parameters, shape (p,).");
}

}  // namespace dqslam
