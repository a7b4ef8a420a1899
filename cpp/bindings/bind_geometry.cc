#include <pybind11/eigen.h>
#include <pybind11/native_enum.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <tuple>
#include <vector>

#include "bindings.h"
#include "dqslam/costs/box_chi_square.h"
#include "dqslam/geometry/axes_jacobians.h"
#include "dqslam/geometry/batch.h"
#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/objects_in_camera.h"
#include "dqslam/geometry/outline.h"

namespace py = pybind11;
using namespace pybind11::literals;

namespace dqslam {
namespace {

/// Matrices of so many rows that are stacked in a table, as one array (n, rows, columns).
py::array_t<double> Unstack(const RowMatrix& stacked, py::ssize_t rows) {
  const std::vector<py::ssize_t> shape = {stacked.rows() / rows, rows, stacked.cols()};
  return py::array(py::cast(stacked)).reshape(shape);
}

Camera MakeCamera(double fx,
                  double fy,
                  double cx,
                  double cy,
                  int width,
                  int height,
                  const Eigen::Matrix<double, 5, 1>& distortion,
                  const Eigen::Matrix<double, 7, 1>& robot_from_camera) {
  Camera camera{fx, fy, cx, cy, width, height, distortion, robot_from_camera};
  camera.Validate();
  return camera;
}

void BindCamera(py::module_& m) {
  py::class_<Camera>(m, "Camera", "Pinhole camera, rigidly mounted on the robot. Immutable.")
      .def(py::init(&MakeCamera),
           "fx"_a,
           "fy"_a,
           "cx"_a,
           "cy"_a,
           "width"_a,
           "height"_a,
           py::kw_only(),
           "distortion"_a = Camera().distortion,
           "robot_from_camera"_a = Camera().robot_from_camera,
           "Focal lengths, principal point and size in pixels; k1 k2 p1 p2 k3; the SE(3) mount.")
      .def_readonly("fx", &Camera::fx, "Focal length, pixels.")
      .def_readonly("fy", &Camera::fy, "Focal length, pixels.")
      .def_readonly("cx", &Camera::cx, "Principal point, pixels.")
      .def_readonly("cy", &Camera::cy, "Principal point, pixels.")
      .def_readonly("width", &Camera::width, "Pixels.")
      .def_readonly("height", &Camera::height, "Pixels.")
      .def_readonly("distortion", &Camera::distortion, "k1 k2 p1 p2 k3, shape (5,).")
      .def_readonly("robot_from_camera", &Camera::robot_from_camera, "SE(3) pose, shape (7,).")
      .def_property_readonly("has_distortion", &Camera::HasDistortion)
      .def("__repr__",
           [](const Camera& c) {
             return py::str("Camera({} x {} px, fx={:g}, fy={:g}, cx={:g}, cy={:g}{})")
                 .format(c.width,
                         c.height,
                         c.fx,
                         c.fy,
                         c.cx,
                         c.cy,
                         c.HasDistortion() ? ", distorted" : "");
           })
      .def("undistort_points",
           &Camera::UndistortPoints,
           "distorted"_a,
           "Ideal pinhole pixels of distorted pixels, shape (n, 2).")
      .def("distort_points",
           &Camera::DistortPoints,
           "undistorted"_a,
           "Distorted pixels of ideal pinhole pixels, shape (n, 2).")
      .def("undistort_boxes",
           &Camera::UndistortBoxes,
           "distorted"_a,
           "Boxes, shape (n, 4), each edge undistorted at its middle.")
      .def("distort_boxes",
           &Camera::DistortBoxes,
           "undistorted"_a,
           "Boxes as recorded, shape (n, 4): inverts undistort_boxes, to a small part of a pixel.");
}

void BindPoses(py::module_& m) {
  m.def("compose",
        &ComposeRows,
        "model"_a,
        "a_from_b"_a,
        "b_from_c"_a,
        "Compose poses row by row: a_from_c, shape (n, d).");
  m.def("between",
        &BetweenRows,
        "model"_a,
        "a_from_b"_a,
        "a_from_c"_a,
        "Relative poses row by row: b_from_c, shape (n, d).");
  m.def("inverse",
        &InverseRows,
        "model"_a,
        "a_from_b"_a,
        "Invert poses row by row: b_from_a, shape (n, d).");
  m.def(
      "adjoint",
      [](PoseModel model, const RowMatrix& a_from_b) {
        const RowMatrix adjoints = AdjointRows(model, a_from_b);
        return Unstack(adjoints, adjoints.cols());
      },
      "model"_a,
      "a_from_b"_a,
      "Matrices (n, k, k) that turn a small motion in the frame of b into the same motion in the "
      "frame of a.");
  m.def("plus",
        &PlusRows,
        "model"_a,
        "poses"_a,
        "tangents"_a,
        "Move poses (n, d) by tangents (n, k), in the frames of the poses.");
  m.def("minus",
        &MinusRows,
        "model"_a,
        "poses"_a,
        "origins"_a,
        "Tangents (n, k) that move the origins to the poses.");
  m.def("dead_reckon",
        &DeadReckonRows,
        "model"_a,
        "first"_a,
        "relative"_a,
        "Chain relative poses (n, d) behind the first (d,): shape (n + 1, d).");
  m.def("world_from_camera",
        &WorldFromCameraRows,
        "model"_a,
        "camera"_a,
        "poses"_a,
        "SE(3) poses of the camera, shape (n, 7).");
}

void BindEllipsoid(py::module_& m) {
  m.def("ellipsoid_from_axes",
        &EllipsoidFromAxes,
        "center"_a,
        "semi_axes"_a,
        "orientation_xyzw"_a,
        "Log-Cholesky parameters (9,) of a center, semi-axes [m] and world_from_object rotation.");
  m.def(
      "axes_from_ellipsoid",
      [](const Vector9d& ellipsoid) {
        const EllipsoidAxes axes = AxesFromEllipsoid(ellipsoid);
        return std::make_tuple(axes.center, axes.semi_axes, axes.orientation_xyzw);
      },
      "ellipsoid"_a,
      "Center (3,), semi-axes (3,) descending [m], orientation x y z w (4,).");
  m.def("dual_quadric_from_ellipsoid",
        &DualQuadricFromEllipsoid,
        "ellipsoid"_a,
        "q1 .. q9 of [S&M17] eq. (2) from log-Cholesky parameters, shape (9,).");
  m.def("ellipsoid_from_dual_quadric",
        &EllipsoidFromDualQuadric,
        "quadric"_a,
        "Log-Cholesky parameters (9,) of q1 .. q9; ValueError when q is no ellipsoid.");
  m.def("dual_quadric_matrix",
        &DualQuadricMatrix,
        "quadric"_a,
        "The 4 x 4 matrix Q* of q1 .. q9, with Q*(4,4) = 1.");
  m.def(
      "ellipsoid_shapes",
      [](const RowMatrix& ellipsoids) { return Unstack(EllipsoidShapeRows(ellipsoids), 3); },
      "ellipsoids"_a,
      "Shapes S [m^2], (n, 3, 3), of log-Cholesky parameters (n, 9).");
  m.def(
      "dual_quadric_shapes",
      [](const RowMatrix& quadrics) { return Unstack(DualQuadricShapeRows(quadrics), 3); },
      "quadrics"_a,
      "Shapes S = c c^T - Q*_33 [m^2], (n, 3, 3), of any signature, of q1 .. q9 (n, 9).");
  m.def("log_semi_axes_jacobian",
        &LogSemiAxesJacobian,
        "ellipsoid"_a,
        "Logarithms of the semi-axes, descending, by the parameters of an ellipsoid: (3, 9).");
  m.def(
      "shape_from_axes_jacobian",
      &ShapeFromAxesJacobian,
      "semi_axes"_a,
      "orientation_xyzw"_a,
      "Log-Cholesky shape by the logarithms of the semi-axes and a turn about each [rad]: (6, 6).");
}

void BindProjection(py::module_& m) {
  m.def("project_to_boxes",
        py::overload_cast<PoseModel, const Camera&, const RowMatrix&, const RowMatrix&>(
            &ProjectToBoxesRows),
        "model"_a,
        "camera"_a,
        "poses"_a,
        "ellipsoids"_a,
        "Boxes (n, 4) of ellipsoid i from pose i [undistorted px], and whether it is strictly in "
        "front (n,); NaN where it is not.");
  m.def(
      "project_bodies_to_boxes",
      [](PoseModel model,
         const Camera& camera,
         const RowMatrix& poses,
         const std::vector<Shape>& shapes,
         const RowMatrix& centers,
         const RowMatrix& factors) {
        return ProjectToBoxesRows(model, camera, poses, BodyTable{shapes, centers, factors});
      },
      "model"_a,
      "camera"_a,
      "poses"_a,
      "shapes"_a,
      "centers"_a,
      "factors"_a,
      "What project_to_boxes returns, of cuboids and cylinders: their centers (n, 3) [m] and "
      "half-axes in the world, the columns of a matrix that is a row of the factors (n, 9) [m].");
  m.def("edges_out_of_sight",
        &EdgesOutOfSightRows,
        "model"_a,
        "camera"_a,
        "poses"_a,
        "ellipsoids"_a,
        "Edges (n, 4) of the same boxes that the outline touches outside the image, where no "
        "detector sees it.");
  m.def(
      "differentiate_boxes",
      [](PoseModel model,
         const Camera& camera,
         const RowMatrix& poses,
         const RowMatrix& ellipsoids) {
        const auto [boxes, in_front, jacobians] =
            DifferentiateBoxesRows(model, camera, poses, ellipsoids);
        return std::make_tuple(boxes, in_front, Unstack(jacobians, kBoxSize));
      },
      "model"_a,
      "camera"_a,
      "poses"_a,
      "ellipsoids"_a,
      "What project_to_boxes returns, and Jacobians (n, 4, k + 9) of the boxes by the tangent of "
      "the pose, then by the ellipsoid; NaN where it is not strictly in front.");
  m.def(
      "project_to_outlines",
      [](PoseModel model,
         const Camera& camera,
         const RowMatrix& poses,
         const RowMatrix& ellipsoids,
         int points) {
        return Unstack(ProjectToOutlinesRows(model, camera, poses, ellipsoids, points), points);
      },
      "model"_a,
      "camera"_a,
      "poses"_a,
      "ellipsoids"_a,
      py::kw_only(),
      "points"_a = kOutlinePoints,
      "Outlines (n, points, 2) of ellipsoid i from pose i [undistorted px], the last point the "
      "first again; NaN where it is not strictly in front.");
  m.def(
      "box_chi_squares",
      py::overload_cast<PoseModel,
                        const Camera&,
                        const RowMatrix&,
                        const RowMatrix&,
                        const RowMatrix&,
                        const RowMatrix&,
                        const BoolTable&>(&BoxChiSquareRows),
      "model"_a,
      "camera"_a,
      "poses"_a,
      "ellipsoids"_a,
      "boxes"_a,
      "covariances"_a,
      "truncated"_a,
      "Chi-squares (n,), 4 degrees of freedom, of boxes (n, 4) with covariances (n, 16) [px^2] and "
      "edges that the image border cut (n, 4), for ellipsoid i from pose i. An edge that only "
      "bounds the object counts where the prediction ends inside. Infinite unless the object is "
      "strictly in front.");
  m.def(
      "body_chi_squares",
      [](PoseModel model,
         const Camera& camera,
         const RowMatrix& poses,
         const std::vector<Shape>& shapes,
         const RowMatrix& centers,
         const RowMatrix& factors,
         const RowMatrix& boxes,
         const RowMatrix& covariances,
         const BoolTable& truncated) {
        const BodyTable bodies{shapes, centers, factors};
        return BoxChiSquareRows(model, camera, poses, bodies, boxes, covariances, truncated);
      },
      "model"_a,
      "camera"_a,
      "poses"_a,
      "shapes"_a,
      "centers"_a,
      "factors"_a,
      "boxes"_a,
      "covariances"_a,
      "truncated"_a,
      "What box_chi_squares returns, of bodies as project_bodies_to_boxes has them.");
}

}  // namespace

void BindGeometry(py::module_& m) {
  py::native_enum<PoseModel>(m, "PoseModel", "enum.Enum", "How a pose is stored.")
      .value("SE2", PoseModel::kSe2)
      .value("SE3", PoseModel::kSe3)
      .finalize();
  py::native_enum<Shape>(m, "Shape", "enum.Enum", "The shape of an object.")
      .value("ELLIPSOID", Shape::kEllipsoid)
      .value("CUBOID", Shape::kCuboid)
      .value("CYLINDER", Shape::kCylinder)
      .value("AUTO", Shape::kAuto)
      .finalize();
  BindCamera(m);
  BindPoses(m);
  BindEllipsoid(m);
  BindProjection(m);
}

}  // namespace dqslam
