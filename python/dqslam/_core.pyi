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
    "BoxTable",
    "CalibrationParameter",
    "CalibrationScore",
    "Camera",
    "Covariance",
    "Fit",
    "Graph",
    "LandmarkModel",
    "Loss",
    "MeasurementTable",
    "Minimizer",
    "Mode",
    "MotionNoise",
    "OdometryTable",
    "OnlineOptions",
    "Placement",
    "PlacementTable",
    "PoseModel",
    "Relocation",
    "Residual",
    "SHARE_OF_INFORMATION",
    "ScenePriors",
    "Schedule",
    "Session",
    "Shape",
    "SizePriorTable",
    "SmoothingLevel",
    "Solution",
    "SolveOptions",
    "Start",
    "State",
    "StepObservations",
    "StepReport",
    "Summary",
    "TrackEquations",
    "TrackFit",
    "TrackProblem",
    "TrackTrajectory",
    "UnderConstrained",
    "VariableKind",
    "adjoint",
    "axes_from_ellipsoid",
    "between",
    "body_chi_squares",
    "box_chi_squares",
    "boxes_of_upright_cuboids",
    "calibration_parameters",
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
    "fit_track",
    "inverse",
    "joint_covariance",
    "linearize_track",
    "log_semi_axes_jacobian",
    "minus",
    "placement_misfits",
    "plus",
    "project_bodies_to_boxes",
    "project_to_boxes",
    "project_to_outlines",
    "recalibrate",
    "relocalize",
    "score_calibration",
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

class Shape(enum.Enum):
    """
    The shape of an object.
    """

    AUTO = 3
    CUBOID = 1
    CYLINDER = 2
    ELLIPSOID = 0

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
    def __repr__(self) -> str: ...
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

class OdometryTable:
    """
    Relative poses between poses. Immutable.
    """
    def __init__(
        self,
        *,
        from_pose: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        to_pose: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        relative: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ) -> None:
        """
        With d the size of a pose and k of its tangent.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (m, k * k).
        """
    @property
    def from_pose(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Shape (m,).
        """
    @property
    def relative(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        to_in_from, shape (m, d).
        """
    @property
    def to_pose(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Shape (m,).
        """

class BoxTable:
    """
    Boxes whose object is known. Immutable.
    """
    def __init__(
        self,
        *,
        pose: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        box: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"],
    ) -> None: ...
    @property
    def box(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Undistorted pixels, shape (b, 4).
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Pixels squared, shape (b, 16).
        """
    @property
    def object(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Shape (b,).
        """
    @property
    def pose(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Shape (b,).
        """
    @property
    def truncated(self) -> typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, n]"]:
        """
        Edges cut by the image border, (b, 4).
        """

class MeasurementTable:
    """
    Measurements of one kind between poses and objects. Immutable.
    """
    def __init__(
        self,
        *,
        kind: str,
        pose: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        value: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    ) -> None: ...
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (n, m * m).
        """
    @property
    def kind(self) -> str:
        """
        "position" or "range".
        """
    @property
    def object(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Shape (n,).
        """
    @property
    def pose(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Shape (n,).
        """
    @property
    def value(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        What was measured, shape (n, m).
        """

class SizePriorTable:
    """
    Prior on the size of each object. Immutable.
    """
    def __init__(
        self,
        *,
        log_mean: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        log_sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        shared: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"] = ...,
    ) -> None: ...
    @property
    def log_mean(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Of semi-axes, log meters, shape (o,).
        """
    @property
    def log_sigma(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Shape (o,).
        """
    @property
    def shared(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        The shared number that is added to each log_mean, or -1; shape (o,) or (0,).
        """

class ScenePriors:
    """
    What is known of the scene; each part is off while its sigma is 0.
    """
    def __init__(self, **kwargs: typing.Any) -> None:
        """
        Any of the attributes as keywords.
        """
    def __repr__(self) -> str: ...
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

class Placement(enum.Enum):
    """
    How an object is placed.
    """

    ALIGNED = 2
    BESIDE = 1
    ON = 0
    UPRIGHT = 3

class PlacementTable:
    """
    How objects are placed; each row may be wrong. Immutable.
    """
    def __init__(
        self,
        *,
        kind: collections.abc.Sequence[Placement],
        object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        other: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        shared: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        distance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    ) -> None: ...
    @property
    def distance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Meters: height of the plane, or largest horizontal distance, shape (p,).
        """
    @property
    def kind(self) -> list[Placement]: ...
    @property
    def object(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Shape (p,).
        """
    @property
    def other(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        Another object, or -1, shape (p,).
        """
    @property
    def shared(self) -> typing.Annotated[numpy.typing.NDArray[numpy.int32], "[m, 1]"]:
        """
        The shared number that is added to the height of a plane, or -1, shape (p,).
        """
    @property
    def sigma(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Meters or radians, shape (p,).
        """

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
        odometry: OdometryTable,
        boxes: BoxTable,
        size_prior: SizePriorTable,
        measurements: collections.abc.Sequence[MeasurementTable] = [],
        scene_priors: ScenePriors = ...,
        shapes: collections.abc.Sequence[Shape] = [],
        shared_sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] = ...,
        placements: PlacementTable | None = None,
    ) -> None:
        """
        initial_poses (n, d): dead reckoning, or the known poses when mapping.
        """
    @property
    def boxes(self) -> BoxTable: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def initial_poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Shape (n, d).
        """
    @property
    def measurements(self) -> list[MeasurementTable]:
        """
        One table a kind.
        """
    @property
    def num_objects(self) -> int: ...
    @property
    def num_poses(self) -> int: ...
    @property
    def odometry(self) -> OdometryTable: ...
    @property
    def placements(self) -> PlacementTable: ...
    @property
    def pose_model(self) -> PoseModel: ...
    @property
    def scene_priors(self) -> ScenePriors: ...
    @property
    def shapes(self) -> list[Shape]:
        """
        One an object; empty if all are ellipsoids.
        """
    @property
    def shared_sigma(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Sigmas of the numbers that priors have in common, shape (s,).
        """
    @property
    def size_prior(self) -> SizePriorTable: ...

class Mode(enum.Enum):
    """
    Which variables are unknown.
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
    How an object is started.
    """

    IDENTITY = 0
    SIZE_PRIOR = 2
    SPHERE = 3
    SVD = 1

class Schedule(enum.Enum):
    """
    The order in which poses are added.
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
    The solver that minimizes.
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
    Options of solve.
    """
    def __init__(self, **kwargs: typing.Any) -> None:
        """
        Set any of the attributes by keywords; the others have their defaults.
        """
    def __repr__(self) -> str: ...
    @property
    def algebraic_sigma(self) -> float:
        """
        Sigma of both algebraic residuals, in the unit of the residual.
        """
    @algebraic_sigma.setter
    def algebraic_sigma(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def backend(self) -> Backend:
        """
        NATIVE is this library's solver, which leaves algebraic residuals, dual quadrics and switchable constraints to Ceres; CERES minimizes everything with Ceres on AutoDiff costs, which is slower.
        """
    @backend.setter
    def backend(self, arg0: Backend) -> None: ...
    @property
    def function_tolerance(self) -> float:
        """
        A batch stage stops when |change of cost| / cost is at most this.
        """
    @function_tolerance.setter
    def function_tolerance(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def grow_angle(self) -> float:
        """
        GROW adds more than grow_poses poses as long as odometry predicts the directions of objects with at most this sigma, in radians.
        """
    @grow_angle.setter
    def grow_angle(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def grow_iterations(self) -> int:
        """
        The largest number of Levenberg-Marquardt iterations after each addition.
        """
    @grow_iterations.setter
    def grow_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def grow_min_views(self) -> int:
        """
        GROW starts an object when it has this number of boxes; the last addition starts all objects.
        """
    @grow_min_views.setter
    def grow_min_views(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def grow_poses(self) -> int:
        """
        GROW adds at least this number of poses at a time.
        """
    @grow_poses.setter
    def grow_poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def grow_tolerance(self) -> float:
        """
        The minimization after an addition stops when |change of cost| / cost is at most this.
        """
    @grow_tolerance.setter
    def grow_tolerance(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def landmark_model(self) -> LandmarkModel:
        """
        The parametrization of the objects.
        """
    @landmark_model.setter
    def landmark_model(self, arg0: LandmarkModel) -> None: ...
    @property
    def loss(self) -> Loss:
        """
        The robust loss on whole boxes.
        """
    @loss.setter
    def loss(self, arg0: Loss) -> None: ...
    @property
    def loss_scale(self) -> float:
        """
        Scale of the HUBER and CAUCHY losses, in sigmas of a whole box.
        """
    @loss_scale.setter
    def loss_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def max_iterations(self) -> int:
        """
        The largest number of iterations of each batch stage.
        """
    @max_iterations.setter
    def max_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def minimizer(self) -> Minimizer:
        """
        The minimizer of the last stage.
        """
    @minimizer.setter
    def minimizer(self, arg0: Minimizer) -> None: ...
    @property
    def mode(self) -> Mode:
        """
        SLAM estimates poses and objects; MAPPING keeps the poses fixed.
        """
    @mode.setter
    def mode(self, arg0: Mode) -> None: ...
    @property
    def outlier_chi_square(self) -> float:
        """
        A box is an outlier if its chi-square (4 degrees of freedom) exceeds this; it is the threshold of all robust losses but HUBER and CAUCHY.
        """
    @outlier_chi_square.setter
    def outlier_chi_square(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def residual(self) -> Residual:
        """
        The residual of the boxes.
        """
    @residual.setter
    def residual(self, arg0: Residual) -> None: ...
    @property
    def schedule(self) -> Schedule:
        """
        BATCH adds all poses at once; GROW adds a few poses at a time.
        """
    @schedule.setter
    def schedule(self, arg0: Schedule) -> None: ...
    @property
    def start(self) -> Start:
        """
        The method by which objects are started.
        """
    @start.setter
    def start(self, arg0: Start) -> None: ...
    @property
    def threads(self) -> int:
        """
        The most threads that work at a time. The result has the same bits with any number. Large problems gain; Ceres uses one thread.
        """
    @threads.setter
    def threads(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...

class State:
    """
    Poses and landmark parameters at which a solve can start.
    """
    def __init__(
        self,
        poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        landmarks: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        shapes: collections.abc.Sequence[Shape] = [],
        shared: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] = ...,
    ) -> None:
        """
        Poses (n, d), landmark parameters (o, 9), their shapes unless all are ellipsoids, and the shared numbers unless all are 0.
        """
    @property
    def landmarks(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Landmark parameters, shape (o, 9).
        """
    @property
    def poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Poses, shape (n, d).
        """
    @property
    def shapes(self) -> list[Shape]:
        """
        One an object; empty if all are ellipsoids.
        """
    @property
    def shared(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Shared numbers, shape (s,); empty if all are 0.
        """

class Summary:
    """
    How a solve went.
    """
    def __repr__(self) -> str: ...
    def __str__(self) -> str: ...
    @property
    def converged(self) -> bool:
        """
        Whether the last stage met a stopping test, with no decrease of the cost left that its model sees, and nothing speaks against the result: the boxes fit, and so does the odometry.
        """
    @property
    def evaluation_seconds(self) -> float:
        """
        Time for residuals and their derivatives in all stages, in seconds.
        """
    @property
    def final_cost(self) -> float:
        """
        Half the sum of squared residuals, in sigmas and after the loss, at the end of the last stage.
        """
    @property
    def gradient_norm_end(self) -> float:
        """
        Infinity norm of the gradient at the end of the last stage.
        """
    @property
    def gradient_norm_start(self) -> float:
        """
        Infinity norm of the gradient at the start of the last stage.
        """
    @property
    def initial_cost(self) -> float:
        """
        Half the sum of squared residuals, in sigmas and after the loss, at the start of the first stage.
        """
    @property
    def iterations(self) -> int:
        """
        Number of iterations of all stages.
        """
    @property
    def linear_solver_seconds(self) -> float:
        """
        Time to order, factorize and solve linear systems in all stages, in seconds.
        """
    @property
    def message(self) -> str:
        """
        The reason why the last stage ended, or what speaks against the result.
        """
    @property
    def rejected_steps(self) -> int:
        """
        Number of rejected steps of all stages.
        """
    @property
    def seconds(self) -> float:
        """
        Wall-clock time of all stages in seconds.
        """
    @property
    def start_seconds(self) -> float:
        """
        The part of `seconds` until all objects had a start.
        """

class Solution:
    """
    The result of solve.
    """
    @property
    def dual_quadrics(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        q1 .. q9 of each object, shape (o, 9).
        """
    @property
    def inliers(self) -> typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, 1]"]:
        """
        Whether each box fits its object, shape (b,).
        """
    @property
    def landmarks(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Parameters in the landmark model, shape (o, 9).
        """
    @property
    def poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Poses, shape (n, d).
        """
    @property
    def shapes(self) -> list[Shape]:
        """
        Shapes of the objects; empty if all are ellipsoids.
        """
    @property
    def shared(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        The shared numbers of the graph, shape (s,).
        """
    @property
    def summary(self) -> Summary:
        """
        How the solve went.
        """
    @property
    def svd_singular_values(
        self,
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Singular values of each object's SVD start, shape (o, 10), descending; NaN where the SVD was not used.
        """

class VariableKind(enum.Enum):
    """
    What a parameter belongs to.
    """

    OBJECT = 1
    POSE = 0

class UnderConstrained:
    """
    A parameter that neither the data nor the priors determine.
    """
    @property
    def kind(self) -> VariableKind:
        """
        Whether it belongs to a pose or an object.
        """
    @property
    def parameter(self) -> int:
        """
        Index of the parameter in its tangent.
        """
    @property
    def row(self) -> int:
        """
        Row of the pose or the object in the graph.
        """

class Covariance:
    """
    Marginal covariances with the first pose fixed.
    """
    @property
    def objects(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Covariances of the landmark parameters, shape (o, 81); NaN where under-constrained.
        """
    @property
    def poses(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Covariances in the frames of the poses, shape (n, k * k); NaN where under-constrained.
        """
    @property
    def shared(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Variances of the shared numbers, shape (s,).
        """
    @property
    def under_constrained(self) -> list[UnderConstrained]:
        """
        The first under-constrained parameter of each pose and object that has one.
        """

class Fit:
    """
    How well measurements fit an estimate.
    """
    @property
    def box_redundancy(self) -> float:
        """
        Sum of 1 - leverage over all edges of boxes.
        """
    @property
    def box_squares(self) -> float:
        """
        Sum of the squared residuals of all edges of boxes, in sigmas.
        """
    @property
    def odometry_leverage(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Leverages from 0 to 1, shape (n, k); 1 where the step alone determines what it measures.
        """
    @property
    def odometry_residuals(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Residuals in sigmas, shape (n, k), one row for each step.
        """

class CalibrationParameter:
    """
    A deviation from what a graph takes for known.
    """
    @property
    def name(self) -> str:
        """
        What it is.
        """
    @property
    def unit(self) -> str:
        """
        Its unit, empty for a share.
        """

class CalibrationScore:
    """
    Score tests of the calibration.
    """
    @property
    def from_boxes(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Covariance of the scores by the noise of boxes, shape (p, p).
        """
    @property
    def from_odometry(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Covariance of the scores by the noise of odometry, shape (p, p).
        """
    @property
    def information(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Information, shape (p, p).
        """
    @property
    def score(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Scores, shape (p,).
        """
    @property
    def unchecked(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Information if all poses and objects were known, shape (p,).
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

class SmoothingLevel:
    """
    A level of smoothing beside the window's.
    """
    def __init__(
        self,
        poses: typing.SupportsInt | typing.SupportsIndex,
        every: typing.SupportsInt | typing.SupportsIndex,
        iterations: typing.SupportsInt | typing.SupportsIndex,
    ) -> None: ...
    def __repr__(self) -> str: ...
    @property
    def every(self) -> int:
        """
        How many steps lie between two smoothings of this level.
        """
    @every.setter
    def every(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def iterations(self) -> int:
        """
        How many Levenberg-Marquardt steps a smoothing takes.
        """
    @iterations.setter
    def iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def poses(self) -> int:
        """
        How many of the last poses are minimized together.
        """
    @poses.setter
    def poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...

class OnlineOptions:
    """
    What a caller of a session may choose.
    """
    def __init__(self, **kwargs: typing.Any) -> None:
        """
        Any of the attributes as keywords.
        """
    def __repr__(self) -> str: ...
    @property
    def long_smoothing(self) -> SmoothingLevel:
        """
        The level that takes the place of a medium one when it is due.
        """
    @long_smoothing.setter
    def long_smoothing(self, arg0: SmoothingLevel) -> None: ...
    @property
    def loop_absence(self) -> int:
        """
        An object closes a loop when it is seen again after more poses than this.
        """
    @loop_absence.setter
    def loop_absence(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def loop_chi_square(self) -> float:
        """
        A loop does not fit when the window's chi-square per residual is above this.
        """
    @loop_chi_square.setter
    def loop_chi_square(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def loop_iterations(self) -> int:
        """
        How many Levenberg-Marquardt steps a loop that does not fit takes.
        """
    @loop_iterations.setter
    def loop_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def loss_scale(self) -> float:
        """
        The scale of a Cauchy loss on whole boxes, in sigmas; 0 stands for least squares.
        """
    @loss_scale.setter
    def loss_scale(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def medium_smoothing(self) -> SmoothingLevel:
        """
        The level that is due more often while a session is young.
        """
    @medium_smoothing.setter
    def medium_smoothing(self, arg0: SmoothingLevel) -> None: ...
    @property
    def misfit_chi_square(self) -> float:
        """
        The last poses and their objects start again when the window's chi-square per residual is above this.
        """
    @misfit_chi_square.setter
    def misfit_chi_square(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> None: ...
    @property
    def recover_every(self) -> int:
        """
        How many steps lie at least between two such starts.
        """
    @recover_every.setter
    def recover_every(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def short_smoothing(self) -> SmoothingLevel:
        """
        The level that repairs what the window froze too early.
        """
    @short_smoothing.setter
    def short_smoothing(self, arg0: SmoothingLevel) -> None: ...
    @property
    def window_iterations(self) -> int:
        """
        How many Levenberg-Marquardt steps the window takes at every step.
        """
    @window_iterations.setter
    def window_iterations(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...
    @property
    def window_poses(self) -> int:
        """
        How many of the last poses are minimized at every step.
        """
    @window_poses.setter
    def window_poses(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> None: ...

class StepReport:
    """
    What a step cost.
    """
    def __repr__(self) -> str: ...
    @property
    def chi_square(self) -> float:
        """
        Of the window, per residual: 1 where the model is right.
        """
    @property
    def closed_loop(self) -> bool:
        """
        A loop that did not fit was solved.
        """
    @property
    def covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Of the new pose, in its tangent, (k, k).
        """
    @covariance.setter
    def covariance(
        self, arg0: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
    ) -> None: ...
    @property
    def first_observation(self) -> int:
        """
        Row of its first observation: boxes as they were given, then positions.
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
        The last poses and their young objects were started again.
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

class StepObservations:
    """
    What one pose saw.
    """
    def __init__(
        self,
        *,
        object: typing.Annotated[numpy.typing.ArrayLike, numpy.int32, "[m, 1]"],
        box: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        covariance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"],
        measurements: collections.abc.Sequence[MeasurementTable] = [],
        log_size_mean: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] = ...,
        log_size_sigma: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"] = ...,
    ) -> None:
        """
        Boxes (n, 4) in undistorted pixels with covariances (n, 16), edges cut by the image border (n, 4) and the row of the object of each (n,); measurements, one table a kind, whose poses are not used; size priors of the new objects. Rows from num_objects on are new objects, in order. A box of object -1 waits and takes no part.
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
        observations: StepObservations,
    ) -> StepReport:
        """
        Add a pose and what it saw; covariance (k, k). The first pose's relative is the pose itself, which is exact if its covariance is empty.
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
    def last_covariance(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Of the last pose, in its tangent, (k, k).
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

class MotionNoise:
    """
    How restlessly things of a kind move.
    """
    def __init__(
        self,
        acceleration: typing.SupportsFloat | typing.SupportsIndex,
        turn: typing.SupportsFloat | typing.SupportsIndex,
        slip: typing.SupportsFloat | typing.SupportsIndex,
        usual_speed: typing.SupportsFloat | typing.SupportsIndex,
        usual_turn: typing.SupportsFloat | typing.SupportsIndex,
    ) -> None: ...
    @property
    def acceleration(self) -> float:
        """
        Density of the white acceleration, m/s^2 / sqrt(Hz): speed changes by so much in 1 s.
        """
    @property
    def slip(self) -> float:
        """
        Density of the motion across the heading, m / sqrt(s).
        """
    @property
    def turn(self) -> float:
        """
        The same of the turn rate, rad/s^2 / sqrt(Hz).
        """
    @property
    def usual_speed(self) -> float:
        """
        Sigma of the speed, m/s.
        """
    @property
    def usual_turn(self) -> float:
        """
        Sigma of the turn rate, rad/s.
        """

class TrackTrajectory:
    """
    States of a thing at its images, and its size.
    """
    def __init__(
        self,
        state: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 6]"],
        log_half: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
    ) -> None: ...
    @property
    def log_half(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Logarithms of half the length, width and height [m], shape (3,).
        """
    @property
    def state(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 6]"]:
        """
        x, y, height above the ground in sigmas, heading, speed, turn rate; (n, 6).
        """

class TrackProblem:
    """
    The boxes of one thing, one an image.
    """
    def __init__(
        self,
        camera: Camera,
        rotation: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        seconds: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        box: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        variance: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"],
        plane: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
        above: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
        log_half: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
        size_precision: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 3]"],
        noise: MotionNoise,
        ground_follows: bool,
    ) -> None: ...

class TrackEquations:
    """
    Normal equations of a track: states in a chain, and the size.
    """
    def solve(
        self, right: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"]
    ) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Solve for right sides of the states, then of the size, shape (6 n + 3, r).
        """
    @property
    def below(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Blocks of each state and the one before it, shape (n - 1, 6, 6).
        """
    @property
    def border(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Blocks of the states and the size, shape (n, 6, 3).
        """
    @property
    def by_camera(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Blocks of each state, and of the size, and the motion of its camera, shape (n, 9, 6).
        """
    @property
    def chi2(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
        """
        Of each box, shape (n,).
        """
    @property
    def corner(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 3]"]:
        """
        Block of the size, shape (3, 3).
        """
    @property
    def cost(self) -> float:
        """
        Half the sum of squares, after the loss.
        """
    @property
    def diagonal(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Blocks of the states, shape (n, 6, 6).
        """
    @property
    def gradient(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 6]"]:
        """
        Of the states, shape (n, 6).
        """
    @property
    def gradient_camera(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 6]"]:
        """
        By these motions, shape (n, 6).
        """
    @property
    def gradient_size(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[3, 1]"]:
        """
        Shape (3,).
        """
    @property
    def log_density(self) -> float:
        """
        What the cost lacks of minus the log density of motion and size: minus this.
        """
    @property
    def of_boxes(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 6]"]:
        """
        What boxes add to the diagonal of the blocks of the states, shape (n, 6).
        """
    @property
    def of_camera(self) -> numpy.typing.NDArray[numpy.float64]:
        """
        Blocks of these motions, shape (n, 6, 6).
        """
    @property
    def rest_by_camera(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        The same by the motions of both cameras, shape (n - 1, 12).
        """
    @property
    def rest_by_state(self) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
        """
        Errors of heights of what rests by the states before and after, (n - 1, 12).
        """

class TrackFit:
    """
    The estimate of a track under one hypothesis.
    """
    @property
    def converged(self) -> bool: ...
    @property
    def equations(self) -> TrackEquations:
        """
        At the estimate.
        """
    @property
    def log_evidence(self) -> float:
        """
        Log of the marginal likelihood, by Laplace's method, up to what all hypotheses share.
        """
    @property
    def trajectory(self) -> TrackTrajectory: ...

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

def body_chi_squares(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    shapes: collections.abc.Sequence[Shape],
    centers: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    factors: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    boxes: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    covariances: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    truncated: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    """
    What box_chi_squares returns, of bodies as project_bodies_to_boxes has them.
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

def boxes_of_upright_cuboids(
    camera: Camera,
    rotation: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    position: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    foot: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    heading: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    half: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[3, 1]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Boxes (n, 4) of a cuboid of half sides (3,) at feet (n, 3) and headings (n,), seen by cameras at positions (n, 3) with axes (3 n, 3), one below the other.
    """

def calibration_parameters() -> list[CalibrationParameter]:
    """
    The parameters of score tests.
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
    Marginal covariances at a state. At the true state they are the posterior Cramer-Rao bound.
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
    Residuals and leverage of odometry and boxes, from which variance components are estimated.
    """

def fit_track(
    problem: TrackProblem,
    start: TrackTrajectory,
    moves: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, 1]"],
    max_iterations: typing.SupportsInt | typing.SupportsIndex,
) -> TrackFit | None:
    """
    Minimize from a start; None where a box is undefined at the start.
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
    Joint covariance of some poses and objects: k rows for each pose, then 9 rows for each object.
    """

def linearize_track(
    problem: TrackProblem,
    at: TrackTrajectory,
    moves: typing.Annotated[numpy.typing.ArrayLike, numpy.bool, "[m, 1]"],
    first: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[6, 1]"],
    information: typing.SupportsFloat | typing.SupportsIndex = 1.0,
) -> TrackEquations | None:
    """
    Normal equations at some states; None where a box is undefined.
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

def placement_misfits(
    graph: Graph, options: SolveOptions, state: State
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, 1]"]:
    """
    Residual norm of each placement at a state, in sigmas and before its switch, shape (p,).
    """

def plus(
    model: PoseModel,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    tangents: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    Move poses (n, d) by tangents (n, k), in the frames of the poses.
    """

def project_bodies_to_boxes(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    shapes: collections.abc.Sequence[Shape],
    centers: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
    factors: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> tuple[
    typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"],
    typing.Annotated[numpy.typing.NDArray[numpy.bool], "[m, 1]"],
]:
    """
    What project_to_boxes returns, of cuboids and cylinders: their centers (n, 3) [m] and half-axes in the world, the columns of a matrix that is a row of the factors (n, 9) [m].
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

def recalibrate(
    graph: Graph,
    state: State,
    timestamps: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
    deviations: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
) -> Graph:
    """
    The graph with deviations of its parameters, shape (p,).
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

def score_calibration(
    graph: Graph,
    options: SolveOptions,
    state: State,
    timestamps: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, 1]"],
) -> CalibrationScore:
    """
    Score tests of camera, mount and odometry at an estimate.
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
    Solve a graph, from its odometry or from a given start. Bad input raises ValueError. The GIL is released; Ctrl-C raises KeyboardInterrupt.
    """

def world_from_camera(
    model: PoseModel,
    camera: Camera,
    poses: typing.Annotated[numpy.typing.ArrayLike, numpy.float64, "[m, n]"],
) -> typing.Annotated[numpy.typing.NDArray[numpy.float64], "[m, n]"]:
    """
    SE(3) poses of the camera, shape (n, 7).
    """

SHARE_OF_INFORMATION: float = 0.8
