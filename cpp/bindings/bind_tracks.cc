#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <stdexcept>
#include <vector>

#include "bindings.h"
#include "dqslam/tracks/chain_factor.h"
#include "dqslam/tracks/fit.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {
namespace {

using tracks::Equations;
using tracks::MotionNoise;
using tracks::TrackFit;
using tracks::TrackProblem;
using tracks::Trajectory;

/// Matrices of so many rows that are stacked in a table, as one array (n, rows, columns).
template <typename Table>
auto Stacked(Table Equations::* table, py::ssize_t rows) {
  return [table, rows](const Equations& equations) {
    const Table& stacked = equations.*table;
    const std::vector<py::ssize_t> shape = {stacked.rows() / rows, rows, stacked.cols()};
    return py::array_t<double>(shape, stacked.data());
  };
}

TrackProblem MakeProblem(const Camera& camera,
                         const RowMatrix& rotation,
                         const RowMatrix& position,
                         const Eigen::VectorXd& seconds,
                         const RowMatrix& box,
                         const RowMatrix& variance,
                         const BoolTable& truncated,
                         const RowMatrix& plane,
                         const Eigen::VectorXd& above,
                         const Eigen::Vector3d& log_half,
                         const Eigen::Matrix3d& size_precision,
                         const MotionNoise& noise,
                         bool ground_follows) {
  const auto has_shape = [count = seconds.size()](const auto& table, Eigen::Index columns) {
    return table.rows() == count && table.cols() == columns;
  };
  if (rotation.rows() != 3 * seconds.size() || rotation.cols() != 3 || !has_shape(position, 3) ||
      !has_shape(box, 4) || !has_shape(variance, 4) || !has_shape(truncated, 4) ||
      !has_shape(plane, 3) || !has_shape(above, 1)) {
    throw std::invalid_argument("the tables of a track need a row for each image");
  }
  TrackProblem problem{camera, {}, log_half, size_precision, noise, ground_follows};
  for (Eigen::Index row = 0; row < seconds.size(); ++row) {
    problem.images.push_back({{rotation.middleRows<3>(3 * row), position.row(row)},
                              seconds[row],
                              box.row(row),
                              variance.row(row),
                              truncated.row(row).transpose(),
                              {plane.row(row), above[row]}});
  }
  return problem;
}

RowMatrix PredictBoxes(const Camera& camera,
                       const RowMatrix& rotation,
                       const RowMatrix& position,
                       const RowMatrix& foot,
                       const Eigen::VectorXd& heading,
                       const Eigen::Vector3d& half) {
  const Eigen::Index count = heading.size();
  if (rotation.rows() != 3 * count || rotation.cols() != 3 || position.rows() != count ||
      position.cols() != 3 || foot.rows() != count || foot.cols() != 3) {
    throw std::invalid_argument("boxes need a view, a foot and a heading each");
  }
  RowMatrix boxes(count, kBoxSize);
  for (Eigen::Index row = 0; row < count; ++row) {
    const tracks::View view{rotation.middleRows<3>(3 * row), position.row(row)};
    boxes.row(row) = tracks::PredictBox(camera, view, {foot.row(row), heading[row], half}).box;
  }
  return boxes;
}

void BindEquations(py::module_& m) {
  py::class_<Equations>(
      m, "TrackEquations", "Normal equations of a track: states in a chain, and the size.")
      .def_readonly("cost", &Equations::cost, "Half the sum of squares, after the loss.")
      .def_readonly("log_density",
                    &Equations::log_density,
                    "What the cost lacks of minus the log density of motion and size: minus this.")
      .def_property_readonly(
          "diagonal", Stacked(&Equations::diagonal, 6), "Blocks of the states, shape (n, 6, 6).")
      .def_property_readonly("below",
                             Stacked(&Equations::below, 6),
                             "Blocks of each state and the one before it, shape (n - 1, 6, 6).")
      .def_readonly("of_boxes",
                    &Equations::of_boxes,
                    "What boxes add to the diagonal of the blocks of the states, shape (n, 6).")
      .def_property_readonly("border",
                             Stacked(&Equations::border, 6),
                             "Blocks of the states and the size, shape (n, 6, 3).")
      .def_readonly("corner", &Equations::corner, "Block of the size, shape (3, 3).")
      .def_readonly("gradient", &Equations::gradient, "Of the states, shape (n, 6).")
      .def_readonly("gradient_size", &Equations::gradient_size, "Shape (3,).")
      .def_property_readonly(
          "by_camera",
          Stacked(&Equations::by_camera, 9),
          "Blocks of each state, and of the size, and the motion of its camera, shape (n, 9, 6).")
      .def_property_readonly("of_camera",
                             Stacked(&Equations::of_camera, 6),
                             "Blocks of these motions, shape (n, 6, 6).")
      .def_readonly(
          "gradient_camera", &Equations::gradient_camera, "By these motions, shape (n, 6).")
      .def_readonly("rest_by_state",
                    &Equations::rest_by_state,
                    "Errors of heights of what rests by the states before and after, (n - 1, 12).")
      .def_readonly("rest_by_camera",
                    &Equations::rest_by_camera,
                    "The same by the motions of both cameras, shape (n - 1, 12).")
      .def_readonly("chi2", &Equations::chi2, "Of each box, shape (n,).")
      .def(
          "solve",
          [](const Equations& equations, const RowMatrix& right) {
            if (right.rows() != equations.gradient.size() + 3) {
              throw std::invalid_argument("a right side has a row for each unknown");
            }
            const auto factor = tracks::ChainFactor::Make(equations);
            if (!factor) throw std::invalid_argument("the equations are not positive definite");
            return factor->Solve(right);
          },
          "right"_a,
          "Solve for right sides of the states, then of the size, shape (6 n + 3, r).");
}

}  // namespace

void BindTracks(py::module_& m) {
  py::class_<MotionNoise>(m, "MotionNoise", "How restlessly things of a kind move.")
      .def(py::init<double, double, double, double, double>(),
           "acceleration"_a,
           "turn"_a,
           "slip"_a,
           "usual_speed"_a,
           "usual_turn"_a)
      .def_readonly("acceleration",
                    &MotionNoise::acceleration,
                    "Density of the white acceleration, m/s^2 / sqrt(Hz): speed changes by so much "
                    "in 1 s.")
      .def_readonly("turn", &MotionNoise::turn, "The same of the turn rate, rad/s^2 / sqrt(Hz).")
      .def_readonly(
          "slip", &MotionNoise::slip, "Density of the motion across the heading, m / sqrt(s).")
      .def_readonly("usual_speed", &MotionNoise::usual_speed, "Sigma of the speed, m/s.")
      .def_readonly("usual_turn", &MotionNoise::usual_turn, "Sigma of the turn rate, rad/s.");
  py::class_<Trajectory>(m, "TrackTrajectory", "States of a thing at its images, and its size.")
      .def(py::init<tracks::StateTable, Eigen::Vector3d>(), "state"_a, "log_half"_a)
      .def_readonly("state",
                    &Trajectory::state,
                    "x, y, height above the ground in sigmas, heading, speed, turn rate; (n, 6).")
      .def_readonly("log_half",
                    &Trajectory::log_half,
                    "Logarithms of half the length, width and height [m], shape (3,).");
  py::class_<TrackProblem>(m, "TrackProblem", "The boxes of one thing, one an image.")
      .def(py::init(&MakeProblem),
           "camera"_a,
           "rotation"_a,
           "position"_a,
           "seconds"_a,
           "box"_a,
           "variance"_a,
           "truncated"_a,
           "plane"_a,
           "above"_a,
           "log_half"_a,
           "size_precision"_a,
           "noise"_a,
           "ground_follows"_a);
  BindEquations(m);
  py::class_<TrackFit>(m, "TrackFit", "The estimate of a track under one hypothesis.")
      .def_readonly("trajectory", &TrackFit::trajectory)
      .def_readonly("equations", &TrackFit::equations, "At the estimate.")
      .def_readonly("log_evidence",
                    &TrackFit::log_evidence,
                    "Log of the marginal likelihood, by Laplace's method, up to what all "
                    "hypotheses share.")
      .def_readonly("converged", &TrackFit::converged);
  m.def("fit_track",
        &tracks::FitTrack,
        "problem"_a,
        "start"_a,
        "moves"_a,
        "max_iterations"_a,
        py::call_guard<py::gil_scoped_release>(),
        "Minimize from a start; None where a box is undefined at the start.");
  m.def("linearize_track",
        &tracks::Linearize,
        "problem"_a,
        "at"_a,
        "moves"_a,
        "first"_a,
        "information"_a = 1.0,
        "Normal equations at some states; None where a box is undefined.");
  m.def("boxes_of_upright_cuboids",
        &PredictBoxes,
        "camera"_a,
        "rotation"_a,
        "position"_a,
        "foot"_a,
        "heading"_a,
        "half"_a,
        "Boxes (n, 4) of a cuboid of half sides (3,) at feet (n, 3) and headings (n,), seen by "
        "cameras at positions (n, 3) with axes (3 n, 3), one below the other.");
  m.attr("SHARE_OF_INFORMATION") = tracks::kShareOfInformation;
}

}  // namespace dqslam
