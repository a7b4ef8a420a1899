#include <pybind11/eigen.h>
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include "bindings.h"
#include "dqslam/estimation/solve.h"
#include "keywords.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {
namespace {

// Ctrl-C at every iteration: true goes on.
bool NoSignal() {
  const py::gil_scoped_acquire gil;
  return PyErr_CheckSignals() == 0;
}

Solution SolveFromPython(const Graph& graph,
                         const SolveOptions& options,
                         const std::optional<State>& start) {
  try {
    const py::gil_scoped_release no_gil;
    return Solve(graph, options, start, NoSignal);
  } catch (const Interrupted&) {
    throw py::error_already_set();  // what PyErr_CheckSignals left
  }
}

void BindEnums(py::module_& m) {
  py::native_enum<Mode>(m, "Mode", "enum.Enum", "What is unknown.")
      .value("SLAM", Mode::kSlam)
      .value("MAPPING", Mode::kMapping)
      .finalize();
  py::native_enum<Residual>(m, "Residual", "enum.Enum", "How a box constrains an object.")
      .value("ALGEBRAIC", Residual::kAlgebraic)
      .value("ALGEBRAIC_NORMALIZED", Residual::kAlgebraicNormalized)
      .value("TANGENT", Residual::kTangent)
      .value("BOX", Residual::kBox)
      .value("TANGENT_THEN_BOX", Residual::kTangentThenBox)
      .finalize();
  py::native_enum<LandmarkModel>(m, "LandmarkModel", "enum.Enum", "The parameters of an object.")
      .value("DUAL_QUADRIC", LandmarkModel::kDualQuadric)
      .value("ELLIPSOID", LandmarkModel::kEllipsoid)
      .finalize();
  py::native_enum<Start>(m, "Start", "enum.Enum", "Where an object starts.")
      .value("IDENTITY", Start::kIdentity)
      .value("SVD", Start::kSvd)
      .value("SIZE_PRIOR", Start::kSizePrior)
      .value("SPHERE", Start::kSphere)
      .finalize();
  py::native_enum<Schedule>(m, "Schedule", "enum.Enum", "In which order poses are added.")
      .value("BATCH", Schedule::kBatch)
      .value("GROW", Schedule::kGrow)
      .finalize();
  py::native_enum<Loss>(m, "Loss", "enum.Enum", "Robust loss on whole boxes.")
      .value("NONE", Loss::kNone)
      .value("HUBER", Loss::kHuber)
      .value("CAUCHY", Loss::kCauchy)
      .value("DCS", Loss::kDcs)
      .value("SWITCHABLE", Loss::kSwitchable)
      .value("GNC_TLS", Loss::kGncTls)
      .value("GNC_GM", Loss::kGncGm)
      .finalize();
  py::native_enum<Backend>(m, "Backend", "enum.Enum", "Who carries out the steps.")
      .value("NATIVE", Backend::kNative)
      .value("CERES", Backend::kCeres)
      .finalize();
  py::native_enum<Minimizer>(m, "Minimizer", "enum.Enum", "The minimizer of the last stage.")
      .value("LEVENBERG_MARQUARDT", Minimizer::kLevenbergMarquardt)
      .value("DOGLEG", Minimizer::kDogleg)
      .finalize();
}

void BindOptions(py::module_& m) {
  py::class_<SolveOptions>(m, "SolveOptions", "What a caller may choose.")
      .def(py::init(&FromKeywords<SolveOptions>), "Any of the attributes as keywords.")
      .def("__repr__", &ShowChanges<SolveOptions>)
      .def_readwrite("mode", &SolveOptions::mode)
      .def_readwrite("residual", &SolveOptions::residual)
      .def_readwrite("landmark_model", &SolveOptions::landmark_model)
      .def_readwrite("start", &SolveOptions::start)
      .def_readwrite("schedule", &SolveOptions::schedule)
      .def_readwrite("loss", &SolveOptions::loss)
      .def_readwrite(
          "loss_scale", &SolveOptions::loss_scale, "Of Huber and Cauchy, sigmas of a whole box.")
      .def_readwrite("outlier_chi_square",
                     &SolveOptions::outlier_chi_square,
                     "Of the other losses: a box beyond it is an outlier (4 dof).")
      .def_readwrite("algebraic_sigma",
                     &SolveOptions::algebraic_sigma,
                     "Of both algebraic residuals, in their own unit.")
      .def_readwrite("backend",
                     &SolveOptions::backend,
                     "NATIVE: normal equations in blocks, boxes differentiated by hand; CERES: "
                     "ceres::Solve on AutoDiff costs, slower, a second opinion.")
      .def_readwrite("minimizer", &SolveOptions::minimizer, "Of the last stage.")
      .def_readwrite("max_iterations", &SolveOptions::max_iterations, "Of each batch stage.")
      .def_readwrite("function_tolerance",
                     &SolveOptions::function_tolerance,
                     "Stop when |change of cost| / cost falls below.")
      .def_readwrite("grow_poses", &SolveOptions::grow_poses, "Poses added at a time, or more:")
      .def_readwrite("grow_rotation",
                     &SolveOptions::grow_rotation,
                     "While the sigma of odometry's rotation over them is below, radians.")
      .def_readwrite("grow_iterations",
                     &SolveOptions::grow_iterations,
                     "Levenberg-Marquardt steps after each addition.")
      .def_readwrite(
          "grow_tolerance", &SolveOptions::grow_tolerance, "Function tolerance of these steps.")
      .def_readwrite("grow_min_views",
                     &SolveOptions::grow_min_views,
                     "Boxes an object needs before it is started.");
}

void BindSolution(py::module_& m) {
  py::class_<State>(m, "State", "Poses and landmark parameters: where a solve starts.")
      .def(py::init<RowMatrix, RowMatrix>(),
           "poses"_a,
           "landmarks"_a,
           "Poses (n, d) and landmark parameters (o, 9).")
      .def_readonly("poses", &State::poses, "Shape (n, d).")
      .def_readonly("landmarks", &State::landmarks, "Shape (o, 9).");
  py::class_<Summary>(m, "Summary", "How a solve went.")
      .def_readonly("initial_cost",
                    &Summary::initial_cost,
                    "Half the sum of squared residuals, in sigmas, after the loss.")
      .def_readonly("final_cost", &Summary::final_cost, "Likewise.")
      .def_readonly("iterations", &Summary::iterations, "Of all stages.")
      .def_readonly("rejected_steps", &Summary::rejected_steps, "Of all stages.")
      .def_readonly("gradient_norm_start",
                    &Summary::gradient_norm_start,
                    "Infinity norm at the start of the last stage.")
      .def_readonly("gradient_norm_end", &Summary::gradient_norm_end, "Likewise at its end.")
      .def_readonly("seconds", &Summary::seconds, "Wall clock, all stages.")
      .def_readonly(
          "start_seconds", &Summary::start_seconds, "Of these, until all objects had a start.")
      .def_readonly("evaluation_seconds",
                    &Summary::evaluation_seconds,
                    "Of all stages: residuals and their derivatives.")
      .def_readonly("linear_solver_seconds",
                    &Summary::linear_solver_seconds,
                    "Of all stages: orderings, factorizations and solutions.")
      .def_readonly("converged",
                    &Summary::converged,
                    "The last stage met a stopping test and accepted a step.")
      .def_readonly("message", &Summary::message, "How it ended, in words.")
      .def("__str__", &ToString)
      .def("__repr__", [](const Summary& s) { return "Summary(" + ToString(s) + ")"; });
  py::class_<Solution>(m, "Solution", "The answer of solve.")
      .def_readonly("poses", &Solution::poses, "Shape (n, d).")
      .def_readonly("landmarks", &Solution::landmarks, "Parameters of the model, shape (o, 9).")
      .def_readonly("dual_quadrics", &Solution::dual_quadrics, "q1 .. q9, shape (o, 9).")
      .def_readonly("svd_singular_values",
                    &Solution::svd_singular_values,
                    "Of each object's SVD start, shape (o, 10), descending; NaN where not used.")
      .def_readonly("inliers", &Solution::inliers, "Boxes that fit their objects, shape (b,).")
      .def_readonly("summary", &Solution::summary);
}

}  // namespace

void BindSolve(py::module_& m) {
  BindEnums(m);
  BindOptions(m);
  BindSolution(m);
  m.def("solve",
        &SolveFromPython,
        "graph"_a,
        py::arg_v("options", SolveOptions(), "SolveOptions()"),
        "start"_a = std::nullopt,
        "Solve a graph, from its odometry or from a given start. Releases the GIL; Ctrl-C raises "
        "KeyboardInterrupt; ValueError for bad input.");
}

}  // namespace dqslam
