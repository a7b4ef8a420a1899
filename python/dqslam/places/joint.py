"""Two recordings of one place as one problem, with the objects that both have as one variable."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.places.alignment import Alignment
from dqslam.places.consensus import MotionName, align
from dqslam.places.landmarks import landmarks_of
from dqslam.subgraph import only_objects, rebuilt
from dqslam.uncertainty import Marginals, marginal_covariances

# The second path begins anywhere [m, rad], as far as odometry says.
_LOOSE = 1e3
_GAP_S = 1.0  # between the times of two recordings that would overlap


@dataclass(frozen=True, eq=False)
class JointMap:
    """The solution of two recordings together, in the frame of the first."""

    graph: Graph
    """Poses of the first recording, then of the second, whose first step is loose."""
    estimate: Estimate
    """Objects of the first recording keep their ids."""
    marginals: Marginals
    """Relative to the first pose."""
    summary: _core.Summary
    """How the solver got there."""
    alignment: Alignment
    """From the map of the first recording to that of the second, where the solver began."""
    merged_ids: Ints
    """Id here of each object of the second map, shape (o,)."""
    time_shift_s: float
    """What was added to the times of the second recording."""


def merge_graphs(
    first: tuple[Graph, Estimate],
    second: tuple[Graph, Estimate],
    options: _core.SolveOptions | None = None,
    *,
    motion: MotionName | None = None,
) -> JointMap:
    """Solve two recordings of one place as one problem.

    Their maps are aligned as by ``align``. Objects that both have become one variable, with the
    boxes of both. The path of the second recording follows that of the first after a step of which
    nothing is known: that is the joint problem of both, for which each is uncertain by itself.

    Parameters
    ----------
    first, second
        The problem of a recording, and its solution.
    options
        Options of the solver, by default those of ``SolveOptions()``.
    motion
        As for ``align``; by default ``se2`` for poses in SE(2), else ``auto``.

    Raises
    ------
    CannotTellError
        If the maps cannot be aligned.
    ValueError
        If the pose models or the cameras differ, which one problem has once.

    Examples
    --------
    >>> import dqslam as dq
    >>> joint = dq.merge_graphs((graph_a, estimate_a), (graph_b, estimate_b))
    >>> dq.save_estimate(joint.estimate, "results/both", marginals=joint.marginals)
    """
    both = (first, second)
    _check(first[0], second[0])
    options = _core.SolveOptions() if options is None else options
    model = first[0].core.pose_model
    plane = model == _core.PoseModel.SE2
    maps = [landmarks_of(one[1], marginal_covariances(*one, options).objects) for one in both]
    found = align(*maps, motion=motion or ("se2" if plane else "auto"))
    a, b = (_mapped(*one) for one in (first, second))
    start_a, start_b = first[1], second[1]
    row_of_b, merged_ids = _rows(a, b, found)
    count = len(a.object_ids)
    new = row_of_b >= count
    frame = _pose(np.asarray(np.linalg.inv(found.b_from_a), dtype=np.float64), model)
    poses = np.concatenate([start_a.poses, _moved(frame, start_b.poses, model)])
    initial = np.concatenate([a.core.initial_poses, _moved(frame, b.core.initial_poses, model)])
    core = _joined(a.core, b.core, poses, initial, row_of_b, new)
    shift = max(float(a.timestamps[-1] + _GAP_S - b.timestamps[0]), 0.0)
    graph = Graph(
        core=core,
        timestamps=np.concatenate([a.timestamps, b.timestamps + shift]),
        object_ids=np.concatenate([a.object_ids, merged_ids[new]]),
        class_names=(*a.class_names, *np.array(b.class_names)[new].tolist()),
        observations=np.bincount(core.boxes.object, minlength=count + int(new.sum())),
        lens=a.lens,
    )
    moved = _moved_ellipsoids(start_b.ellipsoids[new], found.b_from_a)
    state = _core.State(poses, np.concatenate([start_a.ellipsoids, moved]))
    estimate, summary = solve(graph, options, start=state)
    marginals = marginal_covariances(graph, estimate, options)
    return JointMap(graph, estimate, marginals, summary, found, merged_ids, shift)


def _check(a: Graph, b: Graph) -> None:
    if a.core.pose_model != b.core.pose_model:
        names = (a.core.pose_model.name, b.core.pose_model.name)
        raise ValueError(f"merge_graphs: poses in {names[0]} and in {names[1]}, one kind is needed")
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        one, other = (getattr(x.core.camera, name) for x in (a, b))
        if one != other:
            raise ValueError(f"merge_graphs: the cameras differ, {name} is {one:g} and {other:g}")
    if not np.array_equal(a.core.camera.robot_from_camera, b.core.camera.robot_from_camera):
        raise ValueError("merge_graphs: the mounts of the cameras differ")


def _mapped(graph: Graph, estimate: Estimate) -> Graph:
    """Return the problem without the objects that its solution has dropped."""
    kept = np.isin(graph.object_ids, estimate.object_ids)
    return replace(
        graph,
        core=graph.core if kept.all() else only_objects(graph.core, kept),
        object_ids=graph.object_ids[kept],
        class_names=estimate.class_names,
        observations=graph.observations[kept],
    )


def _rows(a: Graph, b: Graph, found: Alignment) -> tuple[Ints, Ints]:
    """Return the row and the id in the joint problem of each object of B, (o,)."""
    row_of_b = np.full(len(b.object_ids), -1)
    row_of_b[np.searchsorted(b.object_ids, found.b_ids)] = np.searchsorted(
        a.object_ids, found.a_ids
    )
    alone = np.flatnonzero(row_of_b < 0)
    row_of_b[alone] = len(a.object_ids) + np.arange(len(alone))
    ids = np.concatenate([a.object_ids, a.object_ids.max() + 1 + np.arange(len(alone))])
    return row_of_b, ids[row_of_b]


def _joined(
    a: _core.Graph, b: _core.Graph, poses: Floats, initial: Floats, row_of_b: Ints, new: Bools
) -> _core.Graph:
    """Return the tables of both, one after the other."""
    before = a.num_poses
    k = round(a.odometry.covariance.shape[1] ** 0.5)
    step = _core.between(a.pose_model, poses[before - 1 : before], poses[before : before + 1])
    loose = np.diag(np.full(k, _LOOSE**2)).reshape(1, -1)
    odometry = _core.OdometryTable(
        from_pose=np.concatenate(
            [a.odometry.from_pose, [before - 1], b.odometry.from_pose + before]
        ),
        to_pose=np.concatenate([a.odometry.to_pose, [before], b.odometry.to_pose + before]),
        relative=np.concatenate([a.odometry.relative, step, b.odometry.relative]),
        covariance=np.concatenate([a.odometry.covariance, loose, b.odometry.covariance]),
    )
    boxes = _core.BoxTable(
        pose=np.concatenate([a.boxes.pose, b.boxes.pose + before]),
        object=np.concatenate([a.boxes.object, row_of_b[b.boxes.object]]),
        box=np.concatenate([a.boxes.box, b.boxes.box]),
        covariance=np.concatenate([a.boxes.covariance, b.boxes.covariance]),
        truncated=np.concatenate([a.boxes.truncated, b.boxes.truncated]),
    )
    prior = _core.SizePriorTable(
        log_mean=np.concatenate([a.size_prior.log_mean, b.size_prior.log_mean[new]]),
        log_sigma=np.concatenate([a.size_prior.log_sigma, b.size_prior.log_sigma[new]]),
    )
    moved = [
        _core.MeasurementTable(
            kind=table.kind,
            pose=table.pose + before,
            object=row_of_b[table.object],
            value=table.value,
            covariance=table.covariance,
        )
        for table in b.measurements
    ]
    return rebuilt(
        a,
        initial_poses=initial,
        odometry=odometry,
        boxes=boxes,
        size_prior=prior,
        measurements=[*a.measurements, *moved],
    )


def _pose(matrix: Floats, model: _core.PoseModel) -> Floats:
    """Return a motion (4, 4) in the form of a pose, (d,)."""
    from scipy.spatial.transform import Rotation

    if model == _core.PoseModel.SE2:
        return np.array([*matrix[:2, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])
    return np.concatenate([matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]).as_quat()])


def _moved(frame: Floats, poses: Floats, model: _core.PoseModel) -> Floats:
    return np.asarray(_core.compose(model, np.tile(frame, (len(poses), 1)), poses))


def _moved_ellipsoids(ellipsoids: Floats, b_from_a: Floats) -> Floats:
    """Return ellipsoids (o, 9) of B in the frame of A."""
    from scipy.spatial.transform import Rotation

    inverse = np.linalg.inv(b_from_a)
    turn = Rotation.from_matrix(inverse[:3, :3])
    moved = [
        _core.ellipsoid_from_axes(
            inverse[:3, :3] @ center + inverse[:3, 3],
            axes,
            (turn * Rotation.from_quat(orientation)).as_quat(),
        )
        for center, axes, orientation in map(_core.axes_from_ellipsoid, ellipsoids)
    ]
    return np.array(moved).reshape(-1, 9)
