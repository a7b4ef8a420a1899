#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings.h"
#include "dqslam/online/relocalize.h"
#include "dqslam/online/session.h"
#include "keywords.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {
namespace {

using online::NewLabels;
using online::OnlineOptions;
using online::Session;
using online::SmoothingLevel;
using online::StepObservations;
using online::StepReport;

void BindOptions(py::module_& m) {
  py::class_<SmoothingLevel>(m, "SmoothingLevel", "A level of smoothing beside the window's.")
      .def(py::init<int, int, int>(), "poses"_a, "every"_a, "iterations"_a)
      .def("__repr__", &ShowChanges<SmoothingLevel>)
      .def_readwrite(
          "poses", &SmoothingLevel::poses, "How many of the last poses are minimized together.")
      .def_readwrite("every",
                     &SmoothingLevel::every,
                     "How many steps lie between two smoothings of this level.")
      .def_readwrite("iterations",
                     &SmoothingLevel::iterations,
                     "How many Levenberg-Marquardt steps a smoothing takes.");
  py::class_<OnlineOptions>(m, "OnlineOptions", "What a caller of a session may choose.")
      .def(py::init(&FromKeywords<OnlineOptions>), "Any of the attributes as keywords.")
      .def("__repr__", &ShowChanges<OnlineOptions>)
      .def_readwrite("window_poses",
                     &OnlineOptions::window_poses,
                     "How many of the last poses are minimized at every step.")
      .def_readwrite("window_iterations",
                     &OnlineOptions::window_iterations,
                     "How many Levenberg-Marquardt steps the window takes at every step.")
      .def_readwrite("short_smoothing",
                     &OnlineOptions::short_smoothing,
                     "The level that repairs what the window froze too early.")
      .def_readwrite("medium_smoothing",
                     &OnlineOptions::medium_smoothing,
                     "The level that is due more often while a session is young.")
      .def_readwrite("long_smoothing",
                     &OnlineOptions::long_smoothing,
                     "The level that takes the place of a medium one when it is due.")
      .def_readwrite("loop_absence",
                     &OnlineOptions::loop_absence,
                     "An object closes a loop when it is seen again after more poses than this.")
      .def_readwrite("loop_chi_square",
                     &OnlineOptions::loop_chi_square,
                     "A loop does not fit when the window's chi-square per residual is above this.")
      .def_readwrite("loop_iterations",
                     &OnlineOptions::loop_iterations,
                     "How many Levenberg-Marquardt steps a loop that does not fit takes.")
      .def_readwrite("misfit_chi_square",
                     &OnlineOptions::misfit_chi_square,
                     "The last poses and their objects start again when the window's chi-square "
                     "per residual is above this.")
      .def_readwrite("recover_every",
                     &OnlineOptions::recover_every,
                     "How many steps lie at least between two such starts.")
      .def_readwrite("loss_scale",
                     &OnlineOptions::loss_scale,
                     "The scale of a Cauchy loss on whole boxes, in sigmas; 0 stands for least "
                     "squares.");
}

void BindReport(py::module_& m) {
  py::class_<StepReport>(m, "StepReport", "What a step cost.")
      .def("__repr__", &ShowChanges<StepReport>)
      .def_readonly("pose", &StepReport::pose, "Row of the new pose.")
      .def_readonly("first_observation",
                    &StepReport::first_observation,
                    "Row of its first observation: boxes as they were given, then positions.")
      .def_readonly("window_poses", &StepReport::window_poses, "Poses of the window.")
      .def_readonly("window_objects", &StepReport::window_objects, "Objects that it saw.")
      .def_readonly("linearized",
                    &StepReport::linearized,
                    "Observations, in the window and to keep what lies before it.")
      .def_readonly("undefined",
                    &StepReport::undefined,
                    "Observations of the window whose objects are not in front.")
      .def_readonly("chi_square",
                    &StepReport::chi_square,
                    "Of the window, per residual: 1 where the model is right.")
      .def_readonly("smoothed_poses",
                    &StepReport::smoothed_poses,
                    "Poses minimized beside the window; 0 at most steps.")
      .def_readonly("smoothed_observations",
                    &StepReport::smoothed_observations,
                    "Observations linearized there.")
      .def_readonly("closed_loop", &StepReport::closed_loop, "A loop that did not fit was solved.")
      .def_readonly("recovered",
                    &StepReport::recovered,
                    "The last poses and their young objects were started again.")
      .def_readwrite(
          "covariance", &StepReport::covariance, "Of the new pose, in its tangent, (k, k).");
}

void BindObservations(py::module_& m) {
  py::class_<StepObservations>(m, "StepObservations", "What one pose saw.")
      .def(py::init<IndexVector,
                    RowMatrix,
                    RowMatrix,
                    BoolTable,
                    std::vector<MeasurementTable>,
                    Eigen::VectorXd,
                    Eigen::VectorXd>(),
           py::kw_only(),
           "object"_a,
           "box"_a,
           "covariance"_a,
           "truncated"_a,
           "measurements"_a = std::vector<MeasurementTable>(),
           "log_size_mean"_a = Eigen::VectorXd(),
           "log_size_sigma"_a = Eigen::VectorXd(),
           "Boxes (n, 4) in undistorted pixels with covariances (n, 16), edges cut by the image "
           "border (n, 4) and the row of the object of each (n,); measurements, one table a kind, "
           "whose poses are not used; size priors of the new objects. Rows from num_objects on "
           "are new objects, in order. A box of object -1 waits and takes no part.");
}

void BindSession(py::module_& m) {
  py::class_<Session>(m, "Session", "Estimation step by step.")
      .def(py::init(&Session::Make),
           "pose_model"_a,
           "camera"_a,
           "scene_priors"_a = ScenePriors(),
           "options"_a = OnlineOptions())
      .def("add",
           &Session::Add,
           "relative"_a,
           "covariance"_a,
           "observations"_a,
           py::call_guard<py::gil_scoped_release>(),
           "Add a pose and what it saw; covariance (k, k). The first pose's relative is the pose "
           "itself, which is exact if its covariance is empty.")
      .def(
          "relabel",
          [](Session& session,
             const IndexVector& observation,
             const IndexVector& object,
             const RowMatrix& ellipsoid,
             const Eigen::VectorXd& log_size_mean,
             const Eigen::VectorXd& log_size_sigma) {
            const py::gil_scoped_release no_gil;
            session.Relabel(
                NewLabels{observation, object, ellipsoid, log_size_mean, log_size_sigma});
          },
          "observation"_a,
          "object"_a,
          "ellipsoid"_a = RowMatrix(0, kLandmarkSize),
          "log_size_mean"_a = Eigen::VectorXd(),
          "log_size_sigma"_a = Eigen::VectorXd(),
          "Give boxes (n,), by the rows of their observations, to other objects (n,): -1 waits, "
          "num_objects + i is a new object that starts from ellipsoid (m, 9), log-Cholesky, in the "
          "world.")
      .def("scale_odometry",
           &Session::ScaleOdometry,
           "translation"_a,
           "rotation"_a,
           "Multiply the standard deviations of all steps, but not of the first pose.")
      .def(
          "add_map_object",
          [](Session& session,
             const Vector9d& ellipsoid,
             const Matrix9d& covariance,
             double log_size_mean,
             double log_size_sigma) {
            session.AddMapObject(ellipsoid, covariance, {log_size_mean, log_size_sigma});
          },
          "ellipsoid"_a,
          "covariance"_a,
          "log_size_mean"_a,
          "log_size_sigma"_a,
          "Add an object of a known map, and the covariance of its parameters, (9, 9).")
      .def(
          "smooth",
          [](Session& session, int iterations, int begin) {
            const py::gil_scoped_release no_gil;
            return session.Smooth(iterations, begin);
          },
          "iterations"_a,
          "begin"_a = 0,
          "Minimize the poses from begin on, the map's priors included; returns the cost.")
      .def("merge",
           &Session::Merge,
           "poses"_a,
           "ellipsoids"_a,
           "Take over an estimate of the first poses and objects; later ones move with them.")
      .def(
          "to_graph",
          [](const Session& session) {
            std::vector<int> rows;
            Graph graph = session.ToGraph(&rows);
            return py::make_tuple(std::move(graph), rows);
          },
          "The problem so far, and the row of each of its objects.")
      .def("clone", &Session::Clone, "A copy that goes its own way.")
      .def_property_readonly("num_poses", &Session::num_poses)
      .def_property_readonly("num_objects", &Session::num_objects)
      .def("pose_at", &Session::PoseAt, "row"_a, "Shape (d,).")
      .def("poses_at", &Session::PosesAt, "rows"_a, "Shape (n, d).")
      .def_property_readonly(
          "last_covariance", &Session::LastCovariance, "Of the last pose, in its tangent, (k, k).")
      .def_property_readonly("poses", &Session::Poses, "Shape (n, d).")
      .def_property_readonly("ellipsoids", &Session::Ellipsoids, "Shape (o, 9).")
      .def_property_readonly("observations", &Session::Observations, "Boxes per object, (o,).");
}

void BindRelocalize(py::module_& m) {
  using online::Relocation;
  py::class_<Relocation>(m, "Relocation", "Where the robot is in a map, and where else it may be.")
      .def_readonly("pose", &Relocation::pose, "world_from_robot, shape (d,).")
      .def_readonly("covariance", &Relocation::covariance, "In the pose's tangent, shape (k, k).")
      .def_readonly("object", &Relocation::object, "Row of the object of each box, -1: none.")
      .def_readonly("chi_square", &Relocation::chi_square, "Of the boxes that have an object.")
      .def_readonly("matches", &Relocation::matches, "Boxes that have an object.")
      .def_readonly("runner_up",
                    &Relocation::runner_up,
                    "Chi-square of the best other place with as many matches; infinite: none.")
      .def_readonly("other", &Relocation::other, "That place, shape (d,).");
  m.def(
      "relocalize",
      [](PoseModel pose_model,
         const Camera& camera,
         const RowMatrix& ellipsoids,
         const RowMatrix& covariance,
         const RowMatrix& box,
         const RowMatrix& box_covariance,
         const BoolTable& truncated,
         const std::vector<std::vector<int>>& candidates,
         int fewest) {
        const py::gil_scoped_release no_gil;
        return online::Relocalize(
            pose_model,
            camera,
            {ellipsoids, covariance, box, box_covariance, truncated, candidates},
            fewest);
      },
      "pose_model"_a,
      "camera"_a,
      "ellipsoids"_a,
      "covariance"_a,
      "box"_a,
      "box_covariance"_a,
      "truncated"_a,
      "candidates"_a,
      "fewest"_a,
      "Find the pose from boxes (b, 4) of objects (o, 9), with covariances (o, 81) and (b, 16); "
      "the candidates of a box are rows of objects that it may show. ValueError where there is "
      "none.");
}

}  // namespace

void BindOnline(py::module_& m) {
  BindRelocalize(m);
  BindOptions(m);
  BindReport(m);
  BindObservations(m);
  BindSession(m);
}

}  // namespace dqslam
