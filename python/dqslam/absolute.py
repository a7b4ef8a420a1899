"""Absolute positions of the robot, for example by GPS, in a frame of their own.

The first pose of a problem is fixed. Here it is the frame of the measured positions, from which the
first pose of the robot and each measured position are relative poses. The core has no cost of a
position alone: the rotation of such a relative pose has a sigma of a thousand radians, and thus no
weight. Its translation has the covariance in the frame of the robot, which is turned by the
estimate until that no longer changes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, reject_rows, require
from dqslam._core import SolveOptions
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.recording import AbsolutePositions
from dqslam.subgraph import only_objects, rebuilt
from dqslam.uncertainty import Marginals, marginal_covariances

# Sigma of what is not measured: meters and radians.
_LOOSE = 1e3
# The covariances are turned again until no rotation changes by more than this [rad], or so often.
_SMALL_TURN = 1e-3
_ROUNDS = 4
# Positions must spread by so many of their sigmas for the rotation of their frame to be determined.
_LEAST_SPREAD = 3.0


def solve_with_absolute_positions(
    graph: Graph,
    absolute: AbsolutePositions,
    options: SolveOptions | None = None,
    *,
    start: Estimate | None = None,
) -> tuple[Estimate, Marginals, _core.Summary]:
    """Estimate poses and objects in the frame of measured positions of the robot.

    On the plane, heights are ignored. The positions are not tested for outliers.

    Parameters
    ----------
    graph
        The problem without the positions.
    options
        As for ``solve``.
    start
        An estimate of the problem; by default it is solved without the positions first.

    Returns
    -------
    estimate, marginals
        In the frame of the positions, in which the first pose, too, has a covariance. The initial
        poses of the estimate are those of the odometry, from the estimated first pose on.
    summary
        Of the last solve.

    Raises
    ------
    ValueError
        If there are scene priors, which are of another frame, or if the positions do not determine
        the rotation of their frame, because they are too near to each other or, in space, to a
        line.

    Examples
    --------
    >>> import dqslam as dq
    >>> import numpy as np
    >>> recording, truth = dq.simulate(dq.load_scenario("paper"), seed=7)
    >>> rows = np.arange(0, 253, 10)
    >>> positions = np.column_stack([truth.poses[rows, :2], np.zeros(26)])
    >>> absolute = dq.AbsolutePositions(rows, positions, np.tile(1e-4 * np.eye(3), (26, 1, 1)))
    >>> graph = dq.build_graph(recording)
    >>> estimate, marginals, summary = dq.solve_with_absolute_positions(graph, absolute)
    >>> bool(np.abs(estimate.poses[rows, :2] - positions[:, :2]).max() < 0.05)
    True
    """
    call = "solve_with_absolute_positions"
    require(graph, Graph, call, "call build_graph(recording) first")
    require(absolute, AbsolutePositions, call, "AbsolutePositions(pose, position, covariance)")
    options = SolveOptions() if options is None else options
    priors = graph.core.scene_priors
    if priors.upright_sigma > 0 or priors.support_sigma > 0 or priors.camera_height_sigma > 0:
        raise ValueError("scene_priors: they are of another frame than absolute positions")
    reject_rows(
        "absolute.pose",
        (absolute.pose < 0) | (absolute.pose >= graph.core.num_poses),
        f"no such pose (there are {graph.core.num_poses})",
        absolute.pose,
    )
    estimate = solve(graph, options)[0] if start is None else start
    kept = np.isin(graph.object_ids, estimate.object_ids)
    graph = replace(
        graph,
        core=only_objects(graph.core, kept),
        object_ids=graph.object_ids[kept],
        class_names=estimate.class_names,
        observations=graph.observations[kept],
    )
    model = graph.core.pose_model
    poses, ellipsoids = _moved(model, estimate, _frame(model, estimate.poses, absolute))
    dropped = estimate.dropped
    for _ in range(_ROUNDS):
        framed = _framed(graph, absolute, poses)
        state = _core.State(framed.core.initial_poses, ellipsoids)
        found, summary = solve(framed, options, start=state)
        turned = np.abs(_core.minus(model, found.poses[1:], poses))[:, -1 if _plane(model) else 3 :]
        poses = found.poses[1:]
        if set(found.object_ids) != set(graph.object_ids):
            break  # some were dropped: their state is not known any more
        ellipsoids = found.ellipsoids
        if turned[np.unique(absolute.pose)].max() < _SMALL_TURN:
            break
    marginals = marginal_covariances(framed, found, options)
    in_frame = replace(
        found,
        timestamps=graph.timestamps,
        poses=poses,
        initial_poses=_from_first(model, estimate.initial_poses, poses[0]),
        dropped={**dropped, **found.dropped},
    )
    unknown = tuple(
        replace(part, name=part.name - 1) if part.kind == "pose" else part
        for part in marginals.under_constrained
    )
    marginals = replace(marginals, poses=marginals.poses[1:], under_constrained=unknown)
    return in_frame, marginals, summary


def _from_first(model: _core.PoseModel, path: Floats, first: Floats) -> Floats:
    """Return a path (n, d) moved so that it begins at a pose (d,)."""
    count = len(path)
    steps = _core.between(model, np.tile(path[0], (count, 1)), path)
    return _core.compose(model, np.tile(first, (count, 1)), steps)


def _plane(model: _core.PoseModel) -> bool:
    return model == _core.PoseModel.SE2


def _frame(model: _core.PoseModel, poses: Floats, absolute: AbsolutePositions) -> Floats:
    """Return frame_from_world (d,): the rotation and translation that fit the positions best."""
    from scipy.spatial.transform import Rotation

    size = 2 if _plane(model) else 3
    path, target = poses[absolute.pose, :size], absolute.position[:, :size]
    if len(target) < size:
        raise ValueError(f"absolute: {len(target)} positions, at least {size} are needed")
    middle, goal = path.mean(axis=0), target.mean(axis=0)
    left, _, right = np.linalg.svd((target - goal).T @ (path - middle))
    spread = np.linalg.svd(target - goal, compute_uv=False) / np.sqrt(len(target))
    sigma = float(np.sqrt(np.mean(np.diagonal(absolute.covariance[:, :size, :size], 0, 1, 2))))
    if spread[size - 2] < _LEAST_SPREAD * sigma / np.sqrt(len(target)):
        where = "near to each other" if _plane(model) else "on a line"
        raise ValueError(
            f"absolute: the positions lie {where}, and do not determine how their frame is turned"
        )
    flip = np.ones(size)
    flip[-1] = np.sign(np.linalg.det(left @ right))
    rotation = left @ np.diag(flip) @ right
    origin = goal - rotation @ middle
    if _plane(model):
        return np.array([*origin, np.arctan2(rotation[1, 0], rotation[0, 0])])
    return np.concatenate([origin, Rotation.from_matrix(rotation).as_quat()])


def _moved(
    model: _core.PoseModel, estimate: Estimate, frame_from_world: Floats
) -> tuple[Floats, Floats]:
    """Return the poses (n, d) and the ellipsoids (o, 9) of an estimate in another frame."""
    from scipy.spatial.transform import Rotation

    frame = np.tile(frame_from_world, (len(estimate.poses), 1))
    if _plane(model):
        turn = Rotation.from_rotvec([0.0, 0.0, frame_from_world[2]])
        origin = np.array([*frame_from_world[:2], 0.0])
    else:
        turn, origin = Rotation.from_quat(frame_from_world[3:]), frame_from_world[:3]
    ellipsoids = [
        _core.ellipsoid_from_axes(
            turn.apply(center) + origin, axes, (turn * Rotation.from_quat(orientation)).as_quat()
        )
        for center, axes, orientation in map(_core.axes_from_ellipsoid, estimate.ellipsoids)
    ]
    return _core.compose(model, frame, estimate.poses), np.array(ellipsoids).reshape(-1, 9)


def _framed(graph: Graph, absolute: AbsolutePositions, poses: Floats) -> Graph:
    """Return the problem with the frame of the positions as its first pose.

    ``poses`` (n, d) are estimated in that frame; they turn the covariances into the robot's.
    """
    core, model = graph.core, graph.core.pose_model
    odometry, boxes = core.odometry, core.boxes
    k = 3 if _plane(model) else 6
    identity = np.zeros((1, poses.shape[1]))
    identity[0, -1] = 0.0 if _plane(model) else 1.0
    relative, covariance = _relative(model, absolute, poses[absolute.pose])
    count, loose = len(absolute), np.diag(np.full(k, _LOOSE**2)).reshape(1, -1)
    steps = _core.OdometryTable(
        # The core follows the last row into a pose: steps come after positions.
        from_pose=np.concatenate([np.zeros(count + 1, int), odometry.from_pose + 1]),
        to_pose=np.concatenate([absolute.pose + 1, [1], odometry.to_pose + 1]),
        relative=np.concatenate([relative, poses[:1], odometry.relative]),
        covariance=np.concatenate([covariance.reshape(count, -1), loose, odometry.covariance]),
    )
    framed = rebuilt(
        core,
        initial_poses=np.concatenate([identity, poses]),
        odometry=steps,
        boxes=_core.BoxTable(
            pose=boxes.pose + 1,
            object=boxes.object,
            box=boxes.box,
            covariance=boxes.covariance,
            truncated=boxes.truncated,
        ),
        measurements=[
            _core.MeasurementTable(
                kind=table.kind,
                pose=table.pose + 1,
                object=table.object,
                value=table.value,
                covariance=table.covariance,
            )
            for table in core.measurements
        ],
    )
    times = np.concatenate([[graph.timestamps[0] - 1.0], graph.timestamps])
    return replace(graph, core=framed, timestamps=times)


def _relative(
    model: _core.PoseModel, absolute: AbsolutePositions, here: Floats
) -> tuple[Floats, Floats]:
    """Return measured positions as relative poses (a, d), and their covariances (a, k, k)."""
    from scipy.spatial.transform import Rotation

    size = 2 if _plane(model) else 3
    if _plane(model):
        turn = Rotation.from_euler("z", here[:, 2:]).as_matrix()[:, :2, :2]
    else:
        turn = Rotation.from_quat(here[:, 3:]).as_matrix()
    relative = here.copy()
    relative[:, :size] = absolute.position[:, :size]
    k = 3 if _plane(model) else 6
    covariance = np.tile(np.eye(k) * _LOOSE**2, (len(here), 1, 1))
    measured = absolute.covariance[:, :size, :size]
    covariance[:, :size, :size] = turn.transpose(0, 2, 1) @ measured @ turn
    return relative, 0.5 * (covariance + covariance.transpose(0, 2, 1))
