"""
Geometry, costs and solvers of dqslam, in C++.
"""

from __future__ import annotations

import collections.abc
import enum
import typing

import numpy
import numpy.typing

__all__: list[str] = [
    "Backend",
    "Camera",
    "Covariance",
    "Fit",
    "Graph",
    "LandmarkModel",
    "Loss",
    "Minimizer",
    "Mode",
    "OnlineOptions",
    "PoseModel",
    "Relocation",
    "Residual",
    "ScenePriors",
    "Schedule",
    "Session",
    "Solution",
    "SolveOptions",
    "Start",
    "State",
    "StepReport",
    "Summary",
    "adjoint",
    "axes_from_ellipsoid",
    "between",
    "box_chi_squares",
    "compose",
    "covariance",
    "dead_reckon",
    "differentiate_boxes",
    "dual_quadric_from_ellipsoid",
    "dual_quadric_matrix",
    "dual_quadric_shapes",
    "edges_out_of_sight",
    "ellipsoid_from_axes",
    "ellipsoid_from_dual_quadric",
    "ellipsoid_shapes",
    "fit",
    "inverse",
    "joint_covariance",
    "log_semi_axes_jacobian",
    "minus",
    "plus",
    "project_to_boxes",
    "project_to_outlines",
    "relocalize",
    "shape_from_axes_jacobian",
    "solve",
    "world_from_camera",
]

class PoseModel(enum.Enum):
    """
    How a pose is stored.
    """

    SE2 = 0
    SE3 = 1

class Camera:
    """
    Pinhole camera, rigidly mounted on the robot. Immutable.
    """
    def __init__(
        self,
        fx: typing.SupportsFloat | typing.SupportsIndex,
        fy: typing.SupportsFloat | typing.SupportsIndex,
        cx: typing.SupportsFloat | typing.SupportsIndex,
        cy: typing.SupportsFloat | typing.SupportsIndex,
        width: typing.SupportsInt | typing.SupportsIndex,
        height: typing.SupportsInt | typing.SupportsIndex,
        *,
        distortion: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[5, 1]"] = ...,
        robot_from_camera: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[7, 1]"] = ...,
    ) -> None:
        """
        Focal lengths, principal point and size in pixels; k1 k2 p1 p2 k3; the SE(3) mount.
        """
    def distort_boxes(
        self, undistorted: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Boxes as recorded, shape (n, 4): inverts undistort_boxes, to a small part of a pixel.
        """
    def distort_points(
        self, undistorted: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Distorted pixels of ideal pinhole pixels, shape (n, 2).
        """
    def undistort_boxes(
        self, distorted: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Boxes, shape (n, 4), each edge undistorted at its middle.
        """
    def undistort_points(
        self, distorted: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Ideal pinhole pixels of distorted pixels, shape (n, 2).
        """
    @property
    def cx(self) -> float:
        """
        Principal point, pixels.
        """
    @property
    def cy(self) -> float:
        """
        Principal point, pixels.
        """
    @property
    def distortion(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[5, 1]"]:
        """
        k1 k2 p1 p2 k3, shape (5,).
        """
    @property
    def fx(self) -> float:
        """
        Focal length, pixels.
        """
    @property
    def fy(self) -> float:
        """
        Focal length, pixels.
        """
    @property
    def has_distortion(self) -> bool: ...
    @property
    def height(self) -> int:
        """
        Pixels.
        """
    @property
    def robot_from_camera(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[7, 1]"]:
        """
        SE(3) pose, shape (7,).
        """
    @property
    def width(self) -> int:
        """
        Pixels.
        """

class ScenePriors:
    """
    What is known of the scene; each part is off while its sigma is 0.
    """
    def __init__(self, **kwargs: typing.Any) -> None:
        """
        Any of the attributes as keywords.
        """
    @property
    def camera_height(self) -> float:
        """
        Meters above the ground.
        """
    @camera_height.setter
    def camera_height(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def camera_height_sigma(self) -> float:
        """
        Meters.
        """
    @camera_height_sigma.setter
    def camera_height_sigma(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def plane_offset(self) -> float:
        """
        d of the ground n.x + d = 0, meters.
        """
    @plane_offset.setter
    def plane_offset(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def support_sigma(self) -> float:
        """
        Each object stands on the ground: meters.
        """
    @support_sigma.setter
    def support_sigma(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def up(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Unit normal n of the ground, in the world, (3,).
        """
    @up.setter
    def up(
        self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"]
    ) -> None: ...
    @property
    def upright_sigma(self) -> float:
        """
        A principal axis of each object is vertical: radians.
        """
    @upright_sigma.setter
    def upright_sigma(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class Graph:
    """
    The problem as plain tables; ids are row numbers. Immutable.
    """
    def __init__(
        self,
        pose_model: PoseModel,
        camera: Camera,
        *,
        initial_poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        odometry_from: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        odometry_to: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        odometry: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        odometry_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        box_pose: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        box_object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        boxes: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        box_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        box_truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"] | None = None,
        position_pose: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"] = ...,
        position_object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"] = ...,
        positions: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"] = ...,
        position_covariance: typing.Annotated[
            numpy.typing.ArrayLike, numpy.float64, "[m, n]"
        ] = ...,
        log_size_mean: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        log_size_sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        scene_priors: ScenePriors = ...,
    ) -> None:
        """
        Shapes, with d the size of a pose and k of its tangent: initial_poses (n, d); odometry (m, d), to_in_from, with covariance (m, k * k); boxes (b, 4) undistorted pixels with covariance (b, 16) and box_truncated (b, 4), edges cut by the image border; positions (p, 3) object_in_robot, meters, with covariance (p, 9); log_size_mean and log_size_sigma (o,), of semi-axes in log meters.
        """
    @property
    def box_covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def box_object(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def box_pose(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def box_truncated(self) -> typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, n]"]: ...
    @property
    def boxes(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def initial_poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (n, d).
        """
    @property
    def log_size_mean(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
    @property
    def log_size_sigma(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]: ...
    @property
    def num_objects(self) -> int: ...
    @property
    def num_poses(self) -> int: ...
    @property
    def odometry(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def odometry_covariance(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def odometry_from(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def odometry_to(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def pose_model(self) -> PoseModel: ...
    @property
    def position_covariance(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def position_object(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def position_pose(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]: ...
    @property
    def positions(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]: ...
    @property
    def scene_priors(self) -> ScenePriors: ...

class Mode(enum.Enum):
    """
    What is unknown.
    """

    MAPPING = 1
    SLAM = 0

class Residual(enum.Enum):
    """
    How a box constrains an object.
    """

    ALGEBRAIC = 0
    ALGEBRAIC_NORMALIZED = 1
    BOX = 3
    TANGENT = 2
    TANGENT_THEN_BOX = 4

class LandmarkModel(enum.Enum):
    """
    The parameters of an object.
    """

    DUAL_QUADRIC = 0
    ELLIPSOID = 1

class Start(enum.Enum):
    """
    Where an object starts.
    """

    IDENTITY = 0
    SIZE_PRIOR = 2
    SPHERE = 3
    SVD = 1

class Schedule(enum.Enum):
    """
    In which order poses are added.
    """

    BATCH = 0
    GROW = 1

class Loss(enum.Enum):
    """
    Robust loss on whole boxes.
    """

    CAUCHY = 2
    DCS = 3
    GNC_GM = 6
    GNC_TLS = 5
    HUBER = 1
    NONE = 0
    SWITCHABLE = 4

class Backend(enum.Enum):
    """
    Who carries out the steps.
    """

    CERES = 1
    NATIVE = 0

class Minimizer(enum.Enum):
    """
    The minimizer of the last stage.
    """

    DOGLEG = 1
    LEVENBERG_MARQUARDT = 0

class SolveOptions:
    """
    What a caller may choose.
    """

    landmark_model: LandmarkModel
    loss: Loss
    mode: Mode
    residual: Residual
    schedule: Schedule
    start: Start
    def __init__(self, **kwargs: typing.Any) -> None:
        """
        Any of the attributes as keywords.
        """
    @property
    def algebraic_sigma(self) -> float:
        """
        Of both algebraic residuals, in their own unit.
        """
    @algebraic_sigma.setter
    def algebraic_sigma(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def backend(self) -> Backend:
        """
        NATIVE: normal equations in blocks, boxes differentiated by hand; CERES: ceres::Solve on AutoDiff costs, slower, a second opinion.
        """
    @backend.setter
    def backend(self, arg0: Backend) -> None: ...
    @property
    def function_tolerance(self) -> float:
        """
        Stop when |change of cost| / cost falls below.
        """
    @function_tolerance.setter
    def function_tolerance(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def grow_iterations(self) -> int:
        """
        Levenberg-Marquardt steps after each addition.
        """
    @grow_iterations.setter
    def grow_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def grow_min_views(self) -> int:
        """
        Boxes an object needs before it is started.
        """
    @grow_min_views.setter
    def grow_min_views(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def grow_poses(self) -> int:
        """
        Poses added at a time, or more:
        """
    @grow_poses.setter
    def grow_poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def grow_rotation(self) -> float:
        """
        While the sigma of odometry's rotation over them is below, radians.
        """
    @grow_rotation.setter
    def grow_rotation(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def grow_tolerance(self) -> float:
        """
        Function tolerance of these steps.
        """
    @grow_tolerance.setter
    def grow_tolerance(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def loss_scale(self) -> float:
        """
        Of Huber and Cauchy, sigmas of a whole box.
        """
    @loss_scale.setter
    def loss_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_iterations(self) -> int:
        """
        Of each batch stage.
        """
    @max_iterations.setter
    def max_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def minimizer(self) -> Minimizer:
        """
        Of the last stage.
        """
    @minimizer.setter
    def minimizer(self, arg0: Minimizer) -> None: ...
    @property
    def outlier_chi_square(self) -> float:
        """
        Of the other losses: a box beyond it is an outlier (4 dof).
        """
    @outlier_chi_square.setter
    def outlier_chi_square(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...

class State:
    """
    Poses and landmark parameters: where a solve starts.
    """
    def __init__(
        self,
        poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        landmarks: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ) -> None:
        """
        Poses (n, d) and landmark parameters (o, 9).
        """
    @property
    def landmarks(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (o, 9).
        """
    @property
    def poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (n, d).
        """

class Summary:
    """
    How a solve went.
    """
    def __str__(self) -> str: ...
    @property
    def converged(self) -> bool:
        """
        The last stage met a stopping test and accepted a step.
        """
    @property
    def evaluation_seconds(self) -> float:
        """
        Of all stages: residuals and their derivatives.
        """
    @property
    def final_cost(self) -> float:
        """
        Likewise.
        """
    @property
    def gradient_norm_end(self) -> float:
        """
        Likewise at its end.
        """
    @property
    def gradient_norm_start(self) -> float:
        """
        Infinity norm at the start of the last stage.
        """
    @property
    def initial_cost(self) -> float:
        """
        Half the sum of squared residuals, in sigmas, after the loss.
        """
    @property
    def iterations(self) -> int:
        """
        Of all stages.
        """
    @property
    def linear_solver_seconds(self) -> float:
        """
        Of all stages: orderings, factorizations and solutions.
        """
    @property
    def message(self) -> str:
        """
        How it ended, in words.
        """
    @property
    def rejected_steps(self) -> int:
        """
        Of all stages.
        """
    @property
    def seconds(self) -> float:
        """
        Wall clock, all stages.
        """
    @property
    def start_seconds(self) -> float:
        """
        Of these, until all objects had a start.
        """

class Solution:
    """
    The answer of solve.
    """
    @property
    def dual_quadrics(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        q1 .. q9, shape (o, 9).
        """
    @property
    def inliers(self) -> typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, 1]"]:
        """
        Boxes that fit their objects, shape (b,).
        """
    @property
    def landmarks(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Parameters of the model, shape (o, 9).
        """
    @property
    def poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (n, d).
        """
    @property
    def summary(self) -> Summary: ...
    @property
    def svd_singular_values(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Of each object's SVD start, shape (o, 10), descending; NaN where not used.
        """

class Covariance:
    """
    Marginal covariances; the first pose is the gauge.
    """
    @property
    def objects(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Of the landmark parameters, shape (o, 81); NaN where under-constrained.
        """
    @property
    def poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        In the frames of the poses, shape (n, k * k); NaN where under-constrained.
        """
    @property
    def under_constrained(self) -> list[str]:
        """
        One sentence for each pose or object that nothing determines.
        """

class Fit:
    """
    How well measurements fit an estimate.
    """
    @property
    def box_redundancy(self) -> float:
        """
        Sum of 1 - leverage over them.
        """
    @property
    def box_squares(self) -> float:
        """
        Sum over all edges of boxes, in sigmas.
        """
    @property
    def odometry_leverage(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        0..1, shape (n, k): 1 where the step alone determines what it measures.
        """
    @property
    def odometry_residuals(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        In sigmas, shape (n, k), one row a step.
        """

class Relocation:
    """
    Where the robot is in a map, and where else it may be.
    """
    @property
    def chi_square(self) -> float:
        """
        Of the boxes that have an object.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        In the pose's tangent, shape (k, k).
        """
    @property
    def matches(self) -> int:
        """
        Boxes that have an object.
        """
    @property
    def object(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Row of the object of each box, -1: none.
        """
    @property
    def other(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        That place, shape (d,).
        """
    @property
    def pose(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        world_from_robot, shape (d,).
        """
    @property
    def runner_up(self) -> float:
        """
        Chi-square of the best other place with as many matches; infinite: none.
        """

class OnlineOptions:
    """
    What a caller of a session may choose.
    """
    def __init__(self, **kwargs: typing.Any) -> None:
        """
        Any of the attributes as keywords.
        """
    @property
    def lap_every(self) -> int:
        """
        each so many steps.
        """
    @lap_every.setter
    def lap_every(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def lap_poses(self) -> int:
        """
        Minimized rarely,
        """
    @lap_poses.setter
    def lap_poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def loop_absence(self) -> int:
        """
        Poses without a observation before an object closes a loop.
        """
    @loop_absence.setter
    def loop_absence(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def loop_chi_square(self) -> float:
        """
        Of the window, per residual: the loop does not fit.
        """
    @loop_chi_square.setter
    def loop_chi_square(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def loop_iterations(self) -> int:
        """
        Levenberg-Marquardt steps over a loop.
        """
    @loop_iterations.setter
    def loop_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def loss_scale(self) -> float:
        """
        Of a Cauchy loss on boxes, sigmas of a box; 0: least squares.
        """
    @loss_scale.setter
    def loss_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def misfit_chi_square(self) -> float:
        """
        Of the window, per residual: its objects start again.
        """
    @misfit_chi_square.setter
    def misfit_chi_square(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def recent_every(self) -> int:
        """
        each so many steps.
        """
    @recent_every.setter
    def recent_every(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def recent_poses(self) -> int:
        """
        Minimized now and then,
        """
    @recent_poses.setter
    def recent_poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def recover_every(self) -> int:
        """
        Steps between two such starts, at least.
        """
    @recover_every.setter
    def recover_every(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def smoothing_iterations(self) -> int:
        """
        Levenberg-Marquardt steps of these two.
        """
    @smoothing_iterations.setter
    def smoothing_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def tour_every(self) -> int:
        """
        each so many steps.
        """
    @tour_every.setter
    def tour_every(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def tour_poses(self) -> int:
        """
        Minimized by one such step,
        """
    @tour_poses.setter
    def tour_poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def window_iterations(self) -> int:
        """
        Levenberg-Marquardt steps of the window.
        """
    @window_iterations.setter
    def window_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def window_poses(self) -> int:
        """
        Minimized at every step.
        """
    @window_poses.setter
    def window_poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...

class StepReport:
    """
    What a step cost.
    """
    @property
    def chi_square(self) -> float:
        """
        Of the window, per residual: 1 where the model is right.
        """
    @property
    def closed_loop(self) -> bool: ...
    @property
    def first_observation(self) -> int:
        """
        Row of the first it saw: boxes as they were given, then positions.
        """
    @property
    def linearized(self) -> int:
        """
        Observations, in the window and to keep what lies before it.
        """
    @property
    def pose(self) -> int:
        """
        Row of the new pose.
        """
    @property
    def recovered(self) -> bool:
        """
        Young objects were started again.
        """
    @property
    def smoothed_observations(self) -> int:
        """
        Observations linearized there.
        """
    @property
    def smoothed_poses(self) -> int:
        """
        Poses minimized beside the window; 0 at most steps.
        """
    @property
    def undefined(self) -> int:
        """
        Observations of the window whose objects are not in front.
        """
    @property
    def window_objects(self) -> int:
        """
        Objects that it saw.
        """
    @property
    def window_poses(self) -> int:
        """
        Poses of the window.
        """

class Session:
    """
    Estimation step by step.
    """
    def __init__(
        self,
        pose_model: PoseModel,
        camera: Camera,
        scene_priors: ScenePriors = ...,
        options: OnlineOptions = ...,
    ) -> None: ...
    def add(
        self,
        relative: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        box: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        box_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"],
        position_object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        position_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        log_size_mean: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        log_size_sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    ) -> StepReport:
        """
        Add a pose and what it saw: covariance (k, k), boxes (n, 4) with covariances (n, 16), positions (p, 3) with covariances (p, 9), size priors of the new objects. A box of object -1 waits and takes no part. The first pose's relative is the pose itself, exact if its covariance is empty.
        """
    def add_map_object(
        self,
        ellipsoid: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[9, 1]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[9, 9]"],
        log_size_mean: typing.SupportsFloat | typing.SupportsIndex,
        log_size_sigma: typing.SupportsFloat | typing.SupportsIndex,
    ) -> None:
        """
        Add an object of a known map, and the covariance of its parameters, (9, 9).
        """
    def clone(self) -> Session:
        """
        A copy that goes its own way.
        """
    def merge(
        self,
        poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ) -> None:
        """
        Take over an estimate of the first poses and objects; later ones move with them.
        """
    def pose_at(
        self, row: typing.SupportsInt | typing.SupportsIndex
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Shape (d,).
        """
    def poses_at(
        self, rows: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (n, d).
        """
    def relabel(
        self,
        observation: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        ellipsoid: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"] = ...,
        log_size_mean: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] = ...,
        log_size_sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] = ...,
    ) -> None:
        """
        Give boxes (n,), by the rows of their observations, to other objects (n,): -1 waits, num_objects + i is a new object that starts from ellipsoid (m, 9), log-Cholesky, in the world.
        """
    def scale_odometry(
        self,
        translation: typing.SupportsFloat | typing.SupportsIndex,
        rotation: typing.SupportsFloat | typing.SupportsIndex,
    ) -> None:
        """
        Multiply the standard deviations of all steps, but not of the first pose.
        """
    def smooth(
        self,
        iterations: typing.SupportsInt | typing.SupportsIndex,
        begin: typing.SupportsInt | typing.SupportsIndex = 0,
    ) -> float:
        """
        Minimize the poses from begin on, the map's priors included; returns the cost.
        """
    def to_graph(self) -> tuple[Graph, list[int]]:
        """
        The problem so far, and the row of each of its objects.
        """
    @property
    def ellipsoids(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (o, 9).
        """
    @property
    def num_objects(self) -> int: ...
    @property
    def num_poses(self) -> int: ...
    @property
    def observations(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Boxes per object, (o,).
        """
    @property
    def poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (n, d).
        """

def adjoint(
    model: PoseModel, a_from_b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
) -> numpy.typing.NDArray[numpy.float64]:
    """
    Matrices (n, k, k) that turn a small motion in the frame of b into the same motion in the frame of a.
    """

def axes_from_ellipsoid(
    ellipsoid: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[9, 1]"],
) -> tuple[
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"],
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"],
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 1]"],
]:
    """
    Center (3,), semi-axes (3,) descending [m], orientation x y z w (4,).
    """

def between(
    model: PoseModel,
    a_from_b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    a_from_c: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Relative poses row by row: b_from_c, shape (n, d).
    """

def box_chi_squares(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    boxes: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    covariances: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    """
    Chi-squares (n,), 4 degrees of freedom, of boxes (n, 4) with covariances (n, 16) [px^2] and edges that the image border cut (n, 4), for ellipsoid i from pose i. An edge that only bounds the object counts where the prediction ends inside. Infinite unless the object is strictly in front.
    """

def compose(
    model: PoseModel,
    a_from_b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    b_from_c: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Compose poses row by row: a_from_c, shape (n, d).
    """

def covariance(graph: Graph, options: SolveOptions, state: State) -> Covariance:
    """
    Marginal covariances at a state; at the true state, the posterior Cramer-Rao bound.
    """

def dead_reckon(
    model: PoseModel,
    first: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    relative: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Chain relative poses (n, d) behind the first (d,): shape (n + 1, d).
    """

def differentiate_boxes(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> tuple[
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"],
    typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, 1]"],
    numpy.typing.NDArray[numpy.float64],
]:
    """
    What project_to_boxes returns, and Jacobians (n, 4, k + 9) of the boxes by the tangent of the pose, then by the ellipsoid; NaN where it is not strictly in front.
    """

def dual_quadric_from_ellipsoid(
    ellipsoid: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[9, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[9, 1]"]:
    """
    q1 .. q9 of [S&M17] eq. (2) from log-Cholesky parameters, shape (9,).
    """

def dual_quadric_matrix(
    quadric: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[9, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[4, 4]"]:
    """
    The 4 x 4 matrix Q* of q1 .. q9, with Q*(4,4) = 1.
    """

def dual_quadric_shapes(
    quadrics: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> numpy.typing.NDArray[numpy.float64]:
    """
    Shapes S = c c^T - Q*_33 [m^2], (n, 3, 3), of any signature, of q1 .. q9 (n, 9).
    """

def edges_out_of_sight(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, n]"]:
    """
    Edges (n, 4) of the same boxes that the outline touches outside the image, where no detector sees it.
    """

def ellipsoid_from_axes(
    center: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
    semi_axes: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
    orientation_xyzw: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[4, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[9, 1]"]:
    """
    Log-Cholesky parameters (9,) of a center, semi-axes [m] and world_from_object rotation.
    """

def ellipsoid_from_dual_quadric(
    quadric: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[9, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[9, 1]"]:
    """
    Log-Cholesky parameters (9,) of q1 .. q9; ValueError when q is no ellipsoid.
    """

def ellipsoid_shapes(
    ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> numpy.typing.NDArray[numpy.float64]:
    """
    Shapes S [m^2], (n, 3, 3), of log-Cholesky parameters (n, 9).
    """

def fit(graph: Graph, options: SolveOptions, state: State) -> Fit:
    """
    Residuals and leverage of odometry and boxes: what variance components come from.
    """

def inverse(
    model: PoseModel, a_from_b: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Invert poses row by row: b_from_a, shape (n, d).
    """

def joint_covariance(
    graph: Graph,
    options: SolveOptions,
    state: State,
    poses: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex],
    objects: collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Joint covariance of some poses (k rows each), then objects (9 rows each).
    """

def log_semi_axes_jacobian(
    ellipsoid: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[9, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 9]"]:
    """
    Logarithms of the semi-axes, descending, by the parameters of an ellipsoid: (3, 9).
    """

def minus(
    model: PoseModel,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    origins: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Tangents (n, k) that move the origins to the poses.
    """

def plus(
    model: PoseModel,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    tangents: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Move poses (n, d) by tangents (n, k), in the frames of the poses.
    """

def project_to_boxes(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> tuple[
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"],
    typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, 1]"],
]:
    """
    Boxes (n, 4) of ellipsoid i from pose i [undistorted px], and whether it is strictly in front (n,); NaN where it is not.
    """

def project_to_outlines(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    *,
    points: typing.SupportsInt | typing.SupportsIndex = 128,
) -> numpy.typing.NDArray[numpy.float64]:
    """
    Outlines (n, points, 2) of ellipsoid i from pose i [undistorted px], the last point the first again; NaN where it is not strictly in front.
    """

def relocalize(
    pose_model: PoseModel,
    camera: Camera,
    ellipsoids: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    box: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    box_covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"],
    candidates: collections.abc.Sequence[
        collections.abc.Sequence[typing.SupportsInt | typing.SupportsIndex]
    ],
    fewest: typing.SupportsInt | typing.SupportsIndex,
) -> Relocation:
    """
    Find the pose from boxes (b, 4) of objects (o, 9), with covariances (o, 81) and (b, 16); the candidates of a box are rows of objects that it may show. ValueError where there is none.
    """

def shape_from_axes_jacobian(
    semi_axes: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
    orientation_xyzw: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[4, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[6, 6]"]:
    """
    Log-Cholesky shape by the logarithms of the semi-axes and a turn about each [rad]: (6, 6).
    """

def solve(graph: Graph, options: SolveOptions = ..., start: State | None = None) -> Solution:
    """
    Solve a graph, from its odometry or from a given start. Releases the GIL; Ctrl-C raises KeyboardInterrupt; ValueError for bad input.
    """

def world_from_camera(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    SE(3) poses of the camera, shape (n, 7).
    """
