"""The problem of a recording as arrays for the core, and its solution as an estimate."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints, as_floats, require
from dqslam._repr import counted
from dqslam.assumptions import BoxNoise, ClassShapes, SizePrior, SizePriors
from dqslam.coincidence import contradicted_objects
from dqslam.estimate import Estimate
from dqslam.layout import (
    class_names_of,
    flat,
    measurement_table,
    measurements_of,
    objects_of,
    odometry_table,
    shapes_of,
    size_prior_table,
    size_priors_of,
    unknown_medians,
)
from dqslam.lens import Lens, LensCamera, camera_with
from dqslam.recording import Recording

# Where at least this share of all boxes fit, no box is suspected to show something else.
TRUSTED_SHARE = 0.99
# With only two boxes, an object's distance and size cannot be separated.
FEWEST_INLIER_VIEWS = 3
# A few boxes fit some ellipsoid even if all of them are wrong. Therefore at least this number of
# boxes must fit, or this share of all boxes if that is fewer. A small share is not enough, because
# it may be the boxes of a moved object at one of its places.
ENOUGH_INLIERS = 6
ENOUGH_INLIER_SHARE = 1.0 / 3.0
# Where more boxes do not fit, the set of those that do may be another one.
MANY_MISFITS = 0.05
# A solution is better if half its chi-square is lower by this.
LEAST_GAIN = 0.05


@dataclass(frozen=True, eq=False)
class Graph:
    """A problem as arrays for the core, with the ids and names of its rows."""

    core: _core.Graph
    timestamps: Floats
    """Seconds, shape (n,)."""
    object_ids: Ints
    """Id of each object row, ascending, shape (o,)."""
    class_names: tuple[str, ...]
    """The class of most boxes of each object."""
    observations: Ints
    """Number of boxes of each object, shape (o,)."""
    lens: Lens | None = None
    """The lens of the camera, if the core does not know its model."""

    def __repr__(self) -> str:
        """Show the pose model, and how many poses, boxes and objects there are."""
        poses = counted(len(self.timestamps), "pose")
        boxes = counted(len(self.core.boxes.pose), "box")
        objects = counted(len(self.object_ids), "object")
        return f"Graph({self.core.pose_model.name}, {poses}, {boxes} of {objects})"


def build_graph(
    recording: Recording,
    *,
    box_noise: BoxNoise | None = None,
    size_prior: SizePrior | SizePriors | None = None,
    scene_priors: _core.ScenePriors | None = None,
    shapes: _core.Shape | ClassShapes | Mapping[str, _core.Shape] | None = None,
) -> Graph:
    """Make the least-squares problem of a recording, with initial poses from dead reckoning.

    Parameters
    ----------
    box_noise, size_prior
        Assumptions about boxes and objects, by default those of ``BoxNoise`` and ``SizePrior``.
        ``SizePriors`` has a size prior for each class.
    scene_priors
        Priors on the scene, by default none: objects are upright or stand on the ground, and the
        camera has a known height.
    shapes
        The shape of all objects, or of each class by name: ``Shape.CUBOID``, ``CYLINDER``,
        ``ELLIPSOID``, or ``AUTO``, the one that explains an object's boxes best. By default, and
        for classes that are not named, objects are ellipsoids. ``ClassShapes`` has a shape for
        those, too.

    Raises
    ------
    ValueError
        If there are no boxes, if a box has no object id, if there are absolute positions, which
        ``solve_with_absolute_positions`` takes, if a relative position is of an object
        without boxes or a size prior or a shape of a class without boxes, or if the core refuses
        the problem.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording, box_noise=dq.BoxNoise(pixels=1.0))
    >>> graph
    Graph(SE2, 253 poses, 456 boxes of 10 objects)
    """
    require(recording, Recording, "build_graph", "recording, truth = simulate(scenario, seed=0)")
    if recording.absolute is not None:
        raise ValueError("absolute: solve_with_absolute_positions(graph, absolute) takes them")
    box_noise = BoxNoise() if box_noise is None else box_noise
    odometry, detections = recording.odometry, recording.detections
    object_ids, box_object, observations = objects_of(detections)
    class_names = class_names_of(detections, box_object, len(object_ids))
    priors = size_priors_of(size_prior, class_names, detections)
    medians = unknown_medians(priors)
    core = _core.Graph(
        odometry.pose_model,
        recording.camera,
        initial_poses=_core.dead_reckon(
            odometry.pose_model, odometry.first_pose, odometry.relative
        ),
        odometry=odometry_table(odometry, recording.closures),
        boxes=_core.BoxTable(
            pose=detections.pose,
            object=box_object,
            box=detections.box,
            covariance=flat(box_noise.covariance(detections.box, recording.camera)),
            truncated=detections.truncated,
        ),
        size_prior=size_prior_table(priors, medians),
        shared_sigma=np.array([prior.median_log_sigma for prior in medians]),
        measurements=[measurement_table(each, object_ids) for each in measurements_of(recording)],
        scene_priors=_core.ScenePriors() if scene_priors is None else scene_priors,
        shapes=shapes_of(shapes, class_names, detections),
    )
    return Graph(
        core=core,
        timestamps=recording.timestamps,
        object_ids=object_ids,
        class_names=class_names,
        observations=observations,
        lens=recording.camera.lens if isinstance(recording.camera, LensCamera) else None,
    )


def solve(
    graph: Graph,
    options: _core.SolveOptions | None = None,
    *,
    start: _core.State | None = None,
) -> tuple[Estimate, _core.Summary]:
    """Estimate poses and objects.

    The default loss is robust: boxes that do not fit their object have no weight. Objects that too
    few of their boxes fit are in `Estimate.dropped`, with the reason, and not in the estimate, and
    those that their boxes contradict in `Estimate.contradicted`. With free dual quadrics, objects
    that are no ellipsoids have NaN in `Estimate.ellipsoids`.

    Parameters
    ----------
    options
        Options of the solver, by default those of ``SolveOptions()``.
    start
        Initial poses and objects. By default poses start at the odometry, and the solver
        initializes the objects.

    Raises
    ------
    ValueError
        If an option is out of its range, or the start does not fit the problem.

    Examples
    --------
    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> graph = dq.build_graph(recording)
    >>> estimate, summary = dq.solve(graph, dq.SolveOptions(loss=dq.Loss.CAUCHY))
    >>> estimate
    Estimate(SE2, 253 poses, 10 objects)
    >>> summary.converged
    True
    """
    require(graph, Graph, "solve", "call build_graph(recording) first")
    options = _core.SolveOptions() if options is None else options
    require(options, _core.SolveOptions, "solve", "SolveOptions(loss=Loss.CAUCHY)")
    solution = _core.solve(graph.core, options, start)
    if start is None and _may_find_better(options, solution.inliers):
        solution = _solved_again(graph.core, options, solution)
    initial_poses = graph.core.initial_poses
    dual_quadrics = as_floats("solution.dual_quadrics", solution.dual_quadrics, [None, 9])
    landmarks = as_floats("solution.landmarks", solution.landmarks, [None, 9])
    if options.landmark_model == _core.LandmarkModel.ELLIPSOID and not solution.shapes:
        ellipsoids = landmarks
    else:
        ellipsoids = np.array([_ellipsoid_or_nan(q) for q in dual_quadrics]).reshape(-1, 9)
    unfit = _unfit(graph, solution.inliers) if options.loss != _core.Loss.NONE else {}
    kept = ~np.isin(graph.object_ids, list(unfit))
    estimate = Estimate(
        pose_model=graph.core.pose_model,
        camera=graph.core.camera
        if graph.lens is None
        else camera_with(graph.core.camera, graph.lens),
        timestamps=graph.timestamps,
        poses=as_floats("solution.poses", solution.poses, initial_poses.shape),
        initial_poses=initial_poses,
        object_ids=graph.object_ids[kept],
        class_names=tuple(np.array(graph.class_names)[kept].tolist()),
        observations=graph.observations[kept],
        dual_quadrics=dual_quadrics[kept],
        ellipsoids=ellipsoids[kept],
        landmarks=landmarks[kept],
        object_shapes=tuple(
            shape for shape, keep in zip(solution.shapes, kept, strict=False) if keep
        ),
        shared=solution.shared,
        inliers=solution.inliers,
        dropped=unfit,
        contradicted=contradicted_objects(
            graph.core,
            _core.State(solution.poses, np.where(kept[:, None], ellipsoids, np.nan)),
            solution.inliers,
            graph.object_ids,
        ),
    )
    return estimate, solution.summary


def _may_find_better(options: _core.SolveOptions, inliers: Bools) -> bool:
    """Return whether another set of boxes may fit better than the one found, from flags (b,)."""
    graduates = options.loss in (_core.Loss.GNC_TLS, _core.Loss.GNC_GM)
    return graduates and float(np.mean(~inliers)) > MANY_MISFITS


def _solved_again(
    core: _core.Graph, options: _core.SolveOptions, solution: _core.Solution
) -> _core.Solution:
    """Begin the graduated loss again at a solution, and return the better of both.

    It starts from the Cauchy loss of all boxes, those that were given up, too.
    """
    again = _core.solve(core, options, _core.State(solution.poses, solution.landmarks))
    phi = options.outlier_chi_square

    def cost(one: _core.Solution) -> float:
        return float(one.summary.final_cost + 0.5 * phi * np.sum(~one.inliers))

    return again if cost(again) < cost(solution) - LEAST_GAIN else solution


def _unfit(graph: Graph, inliers: Bools) -> dict[int, str]:
    """Return the objects that too few boxes fit, with the reason by id."""
    if inliers.mean() > TRUSTED_SHARE:
        return {}
    views = _inlier_views(graph.core, inliers)
    fit = np.bincount(graph.core.boxes.object[inliers], minlength=len(views))
    needed = np.ceil(np.minimum(ENOUGH_INLIERS, ENOUGH_INLIER_SHARE * graph.observations))
    reasons = {}
    for row, object_id in enumerate(graph.object_ids.tolist()):
        if views[row] < FEWEST_INLIER_VIEWS:
            reasons[object_id] = (
                f"seen in {views[row]} poses by boxes that fit, {FEWEST_INLIER_VIEWS} are needed"
            )
        elif fit[row] < needed[row]:
            reasons[object_id] = (
                f"{fit[row]} of {graph.observations[row]} boxes fit, {needed[row]:.0f} are needed"
            )
    return reasons


def _inlier_views(core: _core.Graph, inliers: Bools) -> Ints:
    """Return the number of poses with a fitting box of each object, shape (o,)."""
    pairs = np.column_stack([core.boxes.object, core.boxes.pose])[inliers]
    seen = np.unique(pairs, axis=0)
    return np.bincount(seen[:, 0], minlength=core.num_objects)


def _ellipsoid_or_nan(dual_quadric: Floats) -> Floats:
    try:
        return _core.ellipsoid_from_dual_quadric(dual_quadric)
    except ValueError:
        return np.full(9, np.nan)
