"""Which motions determine an object: the paper's open problem, for one object and motion at a time.

[S&M17] section 4.3 starts from Q* = I because the SVD start "tends to result in degenerate
solutions in the case of close-to-planar camera trajectories". Here the poses are known (mapping),
so only the object can be wrong.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from dqslam import _core
from dqslam._checks import Floats
from dqslam._core import Camera, LandmarkModel, PoseModel, Residual, SolveOptions, Start, State
from dqslam.assumptions import BoxNoise
from dqslam.graph import Graph, build_graph
from dqslam.io.files import write_json
from dqslam.recording import Detections, Odometry, Recording
from dqslam.simulation.detector import cut_at_border

BOX_SIGMA_PX = 1.0
# A cost that exceeds that of a start at the truth by more than this, half a chi-square, is another
# minimum.
COST_TOLERANCE = 0.05
# The paper's residual for an edge that is off by 1 px, at a distance of 5 m and a width of 200 px:
# side^3 depth^2, in px^4 m^2. With known poses it only scales the cost.
ALGEBRAIC_SIGMA = 2e8

Progress = Callable[[int, int], None]


class CameraMotion(NamedTuple):
    """The path of the robot on the plane, and the place of the object."""

    poses: Floats  # world_from_robot, SE(2), from the origin on, (n, 3)
    camera_heading: float  # counter-clockwise from forward, rad
    object_place: Floats  # meters, (3,); objects are near this place


def _straight(length_m: float) -> Floats:
    return np.column_stack([np.linspace(0.0, length_m, 31), np.zeros((31, 2))])


def _around(turn: float) -> Floats:
    """Return a path on a circle of 5 m, which turns left by an angle [rad]."""
    heading = np.linspace(0.0, turn, 31)
    return np.column_stack([5.0 * np.sin(heading), 5.0 * (1.0 - np.cos(heading)), heading])


_LEFT = np.pi / 2.0
MOTIONS = {
    "straight, sideways": CameraMotion(_straight(3.0), _LEFT, np.array([1.5, 5.0, 0.0])),
    "straight, forward": CameraMotion(_straight(5.0), 0.0, np.array([9.0, 0.0, 0.0])),
    "arc of 60 degrees": CameraMotion(_around(np.pi / 3.0), _LEFT, np.array([0.0, 5.0, 0.0])),
    "full loop": CameraMotion(_around(2.0 * np.pi), _LEFT, np.array([0.0, 5.0, 0.0])),
}
STARTS = {"SVD": Start.SVD, "identity": Start.IDENTITY, "sphere": Start.SPHERE}
ESTIMATORS = ("paper", "dqslam")


def method_options(estimator: str, start: Start) -> SolveOptions:
    """Return the options of an estimator from a start.

    "paper" is the algebraic residual with free dual quadrics, "dqslam" the solver's defaults.
    """
    options = SolveOptions(mode=_core.Mode.MAPPING, schedule=_core.Schedule.BATCH, start=start)
    if estimator == "paper":
        options.residual = Residual.ALGEBRAIC
        options.landmark_model = LandmarkModel.DUAL_QUADRIC
        options.algebraic_sigma = ALGEBRAIC_SIGMA
    return options


@dataclass(frozen=True)
class ObjectSolve:
    """One solve of one object."""

    converged: bool
    """Whether its cost is at most that of a start at the truth, plus ``COST_TOLERANCE``."""
    center_error_m: float
    is_ellipsoid: bool


@dataclass(frozen=True, eq=False)
class DegeneracyTrial:
    """The solves of one seed, which has an object for every motion."""

    solves: dict[tuple[str, str, str], ObjectSolve]
    """By motion, estimator and start."""
    singular_values: dict[str, Floats]
    """Singular values of the SVD start over the largest one, descending, shape (10,), by motion."""


def run_trial(seed: int) -> DegeneracyTrial:
    """Look at an object along every motion, and solve with every estimator from every start."""
    trial = DegeneracyTrial({}, {})
    streams = SeedSequence(seed).spawn(len(MOTIONS))
    for (name, motion), stream in zip(MOTIONS.items(), streams, strict=True):
        graph, ellipsoid = observe(motion, default_rng(stream))
        for estimator in ESTIMATORS:
            for label, start in STARTS.items():
                options = method_options(estimator, start)
                trial.solves[name, estimator, label] = _solve_object(graph, options, ellipsoid)
        fit = _core.solve(graph.core, method_options("paper", Start.SVD))
        trial.singular_values[name] = fit.svd_singular_values[0] / fit.svd_singular_values[0, 0]
    return trial


def observe(motion: CameraMotion, random: Generator) -> tuple[Graph, Floats]:
    """Return the problem of a random object, and its true ellipsoid, shape (9,)."""
    orientation = random.normal(size=4)
    ellipsoid = _core.ellipsoid_from_axes(
        motion.object_place + random.normal(0.0, 0.2, size=3),
        random.uniform(0.15, 0.4, size=3),
        orientation / np.linalg.norm(orientation),
    )
    camera = _camera(motion.camera_heading)
    boxes, in_front = _core.project_to_boxes(
        PoseModel.SE2, camera, motion.poses, np.tile(ellipsoid, (len(motion.poses), 1))
    )
    is_cut = cut_at_border(boxes, camera)[1].any(axis=1)
    pose = np.flatnonzero(in_front & ~is_cut)
    box = (boxes + random.normal(0.0, BOX_SIGMA_PX, size=boxes.shape))[pose]
    graph = build_graph(
        Recording(
            camera=camera,
            timestamps=np.arange(len(motion.poses), dtype=np.float64),
            # The poses are exact and known, so the covariance has no effect.
            odometry=Odometry.from_poses(motion.poses, covariance=np.eye(3)),
            detections=Detections(
                pose=pose,
                box=box,
                score=np.ones(len(pose)),
                class_id=np.zeros_like(pose),
                object_id=np.zeros_like(pose),
                class_names={0: "ellipsoid"},
            ),
        ),
        box_noise=BoxNoise(pixels=BOX_SIGMA_PX, relative=0.0),
    )
    return graph, ellipsoid


def _camera(heading: float) -> Camera:
    """Return the paper's camera, turned from the robot's forward axis by a heading, rad."""
    mount = [[0.0, 0.0, 0.0, 0.0, 0.0, np.sin(heading / 2.0), np.cos(heading / 2.0)]]
    forward = [[0.0, 0.0, 0.0, -0.5, 0.5, -0.5, 0.5]]  # z forward, y down
    robot_from_camera = _core.compose(PoseModel.SE3, mount, forward)[0]
    return Camera(1500.0, 1500.0, 639.5, 511.5, 1280, 1024, robot_from_camera=robot_from_camera)


def _solve_object(graph: Graph, options: SolveOptions, ellipsoid: Floats) -> ObjectSolve:
    is_free = options.landmark_model == LandmarkModel.DUAL_QUADRIC
    true_landmark = _core.dual_quadric_from_ellipsoid(ellipsoid) if is_free else ellipsoid
    best = _core.solve(graph.core, options, State(graph.core.initial_poses, [true_landmark]))
    found = _core.solve(graph.core, options)
    quadric = found.dual_quadrics[0]
    return ObjectSolve(
        converged=found.summary.final_cost < best.summary.final_cost + COST_TOLERANCE,
        center_error_m=float(np.linalg.norm(quadric[[3, 6, 8]] - ellipsoid[:3])),
        is_ellipsoid=_is_ellipsoid(quadric),
    )


def _is_ellipsoid(quadric: Floats) -> bool:
    try:
        _core.ellipsoid_from_dual_quadric(quadric)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class Row:
    """One estimator from one start along one motion, over all trials."""

    motion: str
    estimator: str
    start: str
    converged: float
    """Share of the trials that converged."""
    ellipsoids: float
    center_error_m: tuple[float, float, float]
    """Quartiles: 25 %, median, 75 %."""


@dataclass(frozen=True)
class MotionRow:
    """The results that depend only on the motion, over all trials."""

    motion: str
    singular_values: tuple[float, ...]
    """Medians of the ten singular values of the SVD start over the largest one, descending."""


@dataclass(frozen=True)
class DegeneracyTable:
    """All motions, estimators and starts."""

    trials: int
    seed: int
    motions: tuple[MotionRow, ...]
    rows: tuple[Row, ...]

    def save(self, path: str | Path) -> None:
        """Write the table as JSON; the file is complete or absent."""
        write_json(path, asdict(self))


def run_degeneracy(*, trials: int, seed: int, progress: Progress | None = None) -> DegeneracyTable:
    """Run trials with the seeds seed, seed + 1 and so on.

    ``progress`` is called with (trials done, trials) after each trial.
    """
    for name, value, least in (("trials", trials, 1), ("seed", seed, 0)):
        if value < least:
            raise ValueError(f"{name}: expected {least} or more, got {value}")
    done: list[DegeneracyTrial] = []
    for one in range(seed, seed + trials):
        done.append(run_trial(one))
        if progress is not None:
            progress(len(done), trials)
    return tabulate(seed, done)


def tabulate(seed: int, trials: list[DegeneracyTrial]) -> DegeneracyTable:
    """Summarize trials by motion, estimator and start."""
    return DegeneracyTable(
        trials=len(trials),
        seed=seed,
        motions=tuple(_motion_row(motion, trials) for motion in MOTIONS),
        rows=tuple(_row(key, [trial.solves[key] for trial in trials]) for key in trials[0].solves),
    )


def _motion_row(motion: str, trials: list[DegeneracyTrial]) -> MotionRow:
    values = np.median([trial.singular_values[motion] for trial in trials], axis=0)
    return MotionRow(motion, tuple(values.tolist()))


def _row(key: tuple[str, str, str], solves: list[ObjectSolve]) -> Row:
    low, median, high = np.percentile([one.center_error_m for one in solves], [25, 50, 75])
    return Row(
        *key,
        converged=float(np.mean([one.converged for one in solves])),
        ellipsoids=float(np.mean([one.is_ellipsoid for one in solves])),
        center_error_m=(float(low), float(median), float(high)),
    )
