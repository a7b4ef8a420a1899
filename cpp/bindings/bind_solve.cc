#include <pybind11/eigen.h>
#include <pybind11/native_enum.h>
#include <pybind11/stl.h>

#include <utility>
#include <vector>

#include "bindings.h"
#include "dqslam/estimation/solve.h"
#include "keywords.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {
namespace {

// Checks for Ctrl-C at every iteration; true continues the solve.
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
    throw py::error_already_set();  // the error that PyErr_CheckSignals has set
  }
}

void BindEnums(py::module_& m) {
  py::native_enum<Mode>(m, "Mode", "enum.Enum", "Which variables are unknown.")
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
  py::native_enum<Start>(m, "Start", "enum.Enum", "How an object is started.")
      .value("IDENTITY", Start::kIdentity)
      .value("SVD", Start::kSvd)
      .value("SIZE_PRIOR", Start::kSizePrior)
      .value("SPHERE", Start::kSphere)
      .finalize();
  py::native_enum<Schedule>(m, "Schedule", "enum.Enum", "The order in which poses are added.")
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
  py::native_enum<Backend>(m, "Backend", "enum.Enum", "The solver that minimizes.")
      .value("NATIVE", Backend::kNative)
      .value("CERES", Backend::kCeres)
      .finalize();
  py::native_enum<Minimizer>(m, "Minimizer", "enum.Enum", "The minimizer of the last stage.")
      .value("LEVENBERG_MARQUARDT", Minimizer::kLevenbergMarquardt)
      .value("DOGLEG", Minimizer::kDogleg)
      .finalize();
}

void BindOptions(py::module_& m) {
  py::class_<SolveOptions>(m, "SolveOptions", "Options of solve.")
      .def(py::init(&FromKeywords<SolveOptions>),
           "Set any of the attributes by keywords; the others have their defaults.")
      .def("__repr__", &ShowChanges<SolveOptions>)
      .def_readwrite("mode",
                     &SolveOptions::mode,
                     "SLAM estimates poses and objects; MAPPING keeps the poses fixed.")
      .def_readwrite("residual", &SolveOptions::residual, "The residual of the boxes.")
      .def_readwrite(
          "landmark_model", &SolveOptions::landmark_model, "The parametrization of the objects.")
      .def_readwrite("start", &SolveOptions::start, "The method by which objects are started.")
      .def_readwrite("schedule",
                     &SolveOptions::schedule,
                     "BATCH adds all poses at once; GROW adds a few poses at a time.")
      .def_readwrite("loss", &SolveOptions::loss, "The robust loss on whole boxes.")
      .def_readwrite("loss_scale",
                     &SolveOptions::loss_scale,
                     "Scale of the HUBER and CAUCHY losses, in sigmas of a whole box.")
      .def_readwrite(
          "outlier_chi_square",
          &SolveOptions::outlier_chi_square,
          "A box is an outlier if its chi-square (4 degrees of freedom) exceeds this; it "
          "is the threshold of all robust losses but HUBER and CAUCHY.")
      .def_readwrite("algebraic_sigma",
                     &SolveOptions::algebraic_sigma,
                     "Sigma of both algebraic residuals, in the unit of the residual.")
      .def_readwrite("backend",
                     &SolveOptions::backend,
                     "NATIVE is this library's solver, which leaves algebraic residuals, dual "
                     "quadrics and switchable constraints to Ceres; CERES minimizes everything "
                     "with Ceres on AutoDiff costs, which is slower.")
      .def_readwrite("minimizer", &SolveOptions::minimizer, "The minimizer of the last stage.")
      .def_readwrite("max_iterations",
                     &SolveOptions::max_iterations,
                     "The largest number of iterations of each batch stage.")
      .def_readwrite("function_tolerance",
                     &SolveOptions::function_tolerance,
                     "A batch stage stops when |change of cost| / cost is at most this.")
      .def_readwrite("grow_poses",
                     &SolveOptions::grow_poses,
                     "GROW adds at least this number of poses at a time.")
      .def_readwrite("grow_angle",
                     &SolveOptions::grow_angle,
                     "GROW adds more than grow_poses poses as long as odometry predicts the "
                     "directions of objects with at most this sigma, in radians.")
      .def_readwrite("grow_iterations",
                     &SolveOptions::grow_iterations,
                     "The largest number of Levenberg-Marquardt iterations after each addition.")
      .def_readwrite("grow_tolerance",
                     &SolveOptions::grow_tolerance,
                     "The minimization after an addition stops when |change of cost| / cost is at "
                     "most this.")
      .def_readwrite("grow_min_views",
                     &SolveOptions::grow_min_views,
                     "GROW starts an object when it has this number of boxes; the last addition "
                     "starts all objects.")
      .def_readwrite("threads",
                     &SolveOptions::threads,
                     "The most threads that work at a time. The result has the same bits with any "
                     "number. Large problems gain; Ceres uses one thread.");
}

void BindSolution(py::module_& m) {
  py::class_<State>(m, "State", "Poses and landmark parameters at which a solve can start.")
      .def(py::init([](RowMatrix poses,
                       RowMatrix landmarks,
                       std::vector<Shape> shapes,
                       Eigen::VectorXd shared) {
             return State{
                 std::move(poses), std::move(landmarks), {}, std::move(shapes), std::move(shared)};
           }),
           "poses"_a,
           "landmarks"_a,
           "shapes"_a = std::vector<Shape>(),
           "shared"_a = Eigen::VectorXd(),
           "Poses (n, d), landmark parameters (o, 9), their shapes unless all are ellipsoids, and "
           "the shared numbers unless all are 0.")
      .def_readonly("poses", &State::poses, "Poses, shape (n, d).")
      .def_readonly("landmarks", &State::landmarks, "Landmark parameters, shape (o, 9).")
      .def_readonly("shapes", &State::shapes, "One an object; empty if all are ellipsoids.")
      .def_readonly("shared", &State::shared, "Shared numbers, shape (s,); empty if all are 0.");
  py::class_<Summary>(m, "Summary", "How a solve went.")
      .def_readonly("initial_cost",
                    &Summary::initial_cost,
                    "Half the sum of squared residuals, in sigmas and after the loss, at the start "
                    "of the first stage.")
      .def_readonly("final_cost",
                    &Summary::final_cost,
                    "Half the sum of squared residuals, in sigmas and after the loss, at the end "
                    "of the last stage.")
      .def_readonly("iterations", &Summary::iterations, "Number of iterations of all stages.")
      .def_readonly(
          "rejected_steps", &Summary::rejected_steps, "Number of rejected steps of all stages.")
      .def_readonly("gradient_norm_start",
                    &Summary::gradient_norm_start,
                    "Infinity norm of the gradient at the start of the last stage.")
      .def_readonly("gradient_norm_end",
                    &Summary::gradient_norm_end,
                    "Infinity norm of the gradient at the end of the last stage.")
      .def_readonly("seconds", &Summary::seconds, "Wall-clock time of all stages in seconds.")
      .def_readonly("start_seconds",
                    &Summary::start_seconds,
                    "The part of `seconds` until all objects had a start.")
      .def_readonly("evaluation_seconds",
                    &Summary::evaluation_seconds,
                    "Time for residuals and their derivatives in all stages, in seconds.")
      .def_readonly("linear_solver_seconds",
                    &Summary::linear_solver_seconds,
                    "Time to order, factorize and solve linear systems in all stages, in seconds.")
      .def_readonly("converged",
                    &Summary::converged,
                    "Whether the last stage met a stopping test, with no decrease of the cost left "
                    "that its model sees, and nothing speaks against the result: the boxes fit, "
                    "and so does the odometry.")
      .def_readonly("message",
                    &Summary::message,
                    "The reason why the last stage ended, or what speaks against the result.")
      .def("__str__", &ToString)
      .def("__repr__", [](const Summary& s) { return "Summary(" + ToString(s) + ")"; });
  py::class_<Solution>(m, "Solution", "The result of solve.")
      .def_readonly("poses", &Solution::poses, "Poses, shape (n, d).")
      .def_readonly(
          "landmarks", &Solution::landmarks, "Parameters in the landmark model, shape (o, 9).")
      .def_readonly(
          "shapes", &Solution::shapes, "Shapes of the objects; empty if all are ellipsoids.")
      .def_readonly(
          "dual_quadrics", &Solution::dual_quadrics, "q1 .. q9 of each object, shape (o, 9).")
      .def_readonly(
          "svd_singular_values",
          &Solution::svd_singular_values,
          "Singular values of each object's SVD start, shape (o, 10), descending; NaN where the "
          "SVD was not used.")
      .def_readonly("shared", &Solution::shared, "The shared numbers of the graph, shape (s,).")
      .def_readonly("inliers", &Solution::inliers, "Whether each box fits its object, shape (b,).")
      .def_readonly("summary", &Solution::summary, "How the solve went.");
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
        "Solve a graph, from its odometry or from a given start. Bad input raises ValueError. The "
        "GIL is released; Ctrl-C raises KeyboardInterrupt.");
}

}  // namespace dqslam
