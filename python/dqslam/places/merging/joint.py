"""Two recordings of one place as one problem, with the objects that both have as one variable."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.places.alignment.consensus import MotionName, align
from dqslam.places.alignment.result import Alignment
from dqslam.places.landmarks import landmarks_of
from dqslam.places.merging.tables import joined_tables, moved_ellipsoids, moved_poses, pose_of
from dqslam.subgraph import only_objects
from dqslam.uncertainty import Marginals, marginal_covariances

_GAP_S = 1.0  # between the times of two recordings that would overlap
# Two estimates of one object are farther apart once in a thousand: chi-square, 3 degrees.
ONE_PLACE_CHI2 = 16.27
# A joined object of which fewer boxes of either recording fit is two objects.
LEAST_FIT = 0.5
# Solutions, each with the pairs that the one before has found, and without those it has refuted.
MOST_ROUNDS = 4


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
    why = why_apart(first[0], second[0])
    if why:
        raise ValueError(f"merge_graphs: {why}")
    options = _core.SolveOptions() if options is None else options
    plane = first[0].core.pose_model == _core.PoseModel.SE2
    maps = [landmarks_of(one[1], marginal_covariances(*one, options).objects) for one in both]
    found = align(*maps, motion=motion or ("se2" if plane else "auto"))
    return solve_together(first, second, found, options)


def why_apart(a: Graph, b: Graph) -> str:
    """Return why two problems cannot be one, or nothing if they can."""
    if a.core.pose_model != b.core.pose_model:
        names = (a.core.pose_model.name, b.core.pose_model.name)
        return f"poses in {names[0]} and in {names[1]}, one kind is needed"
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        one, other = (getattr(x.core.camera, name) for x in (a, b))
        if one != other:
            return f"the cameras differ, {name} is {one:g} and {other:g}"
    if not np.array_equal(a.core.camera.robot_from_camera, b.core.camera.robot_from_camera):
        return "the mounts of the cameras differ"
    if a.lens != b.lens or not np.array_equal(a.core.camera.distortion, b.core.camera.distortion):
        return "the lenses of the cameras differ"
    if any(shape != _core.Shape.ELLIPSOID for one in (a, b) for shape in one.core.shapes):
        return "an object is a cuboid or a cylinder, and only ellipsoids are solved together"
    return ""


def solve_together(
    first: tuple[Graph, Estimate],
    second: tuple[Graph, Estimate],
    found: Alignment,
    options: _core.SolveOptions,
) -> JointMap:
    """Solve two problems as one from the alignment of their maps, see ``merge_graphs``.

    With the solution, maps are known better than before: objects of both that it takes to one place
    are joined as well, and all is solved again.
    """
    a, b = (_mapped(*one) for one in (first, second))
    pairs = np.column_stack(
        [np.searchsorted(a.object_ids, found.a_ids), np.searchsorted(b.object_ids, found.b_ids)]
    )
    starts, joint = (first[1], second[1]), None
    refuted = np.zeros((0, 2), dtype=np.int64)
    for _ in range(MOST_ROUNDS):
        joint = _solve_pairs(a, b, starts, found, pairs, options)
        fits = _fit_both(joint, a, pairs)
        refuted = np.concatenate([refuted, pairs[~fits]])
        more = _more_pairs(joint, a, b, pairs, refuted, options)
        if fits.all() and not len(more):
            break
        pairs = np.concatenate([pairs[fits], more])
    assert joint is not None
    return joint


def _fit_both(joint: JointMap, a: Graph, pairs: Ints) -> Bools:
    """Return whether the boxes of both recordings fit the object of each pair, (p,).

    If two objects were taken for one, it is where one of them is, and does not fit the boxes of the
    other.
    """
    boxes, inliers = joint.graph.core.boxes, joint.estimate.inliers
    is_second = boxes.pose >= a.core.num_poses
    rows = pairs[:, 0]
    fits = np.ones(len(pairs), dtype=np.bool_)
    for part in (is_second, ~is_second):
        count = np.bincount(boxes.object[part], minlength=len(joint.graph.object_ids))
        good = np.bincount(boxes.object[part & inliers], minlength=len(count))
        fits &= good[rows] >= LEAST_FIT * count[rows]
    return fits


def _solve_pairs(
    a: Graph,
    b: Graph,
    starts: tuple[Estimate, Estimate],
    found: Alignment,
    pairs: Ints,
    options: _core.SolveOptions,
) -> JointMap:
    model, (start_a, start_b) = a.core.pose_model, starts
    row_of_b, merged_ids = _rows(a, b, pairs)
    count = len(a.object_ids)
    new = row_of_b >= count
    frame = pose_of(np.asarray(np.linalg.inv(found.b_from_a), dtype=np.float64), model)
    poses = np.concatenate([start_a.poses, moved_poses(frame, start_b.poses, model)])
    initial = np.concatenate(
        [a.core.initial_poses, moved_poses(frame, b.core.initial_poses, model)]
    )
    core = joined_tables(a.core, b.core, poses, initial, row_of_b, new)
    shift = time_shift(float(a.timestamps[-1]), float(b.timestamps[0]))
    graph = Graph(
        core=core,
        timestamps=np.concatenate([a.timestamps, b.timestamps + shift]),
        object_ids=np.concatenate([a.object_ids, merged_ids[new]]),
        class_names=(*a.class_names, *np.array(b.class_names)[new].tolist()),
        observations=np.bincount(core.boxes.object, minlength=count + int(new.sum())),
        lens=a.lens,
    )
    moved = moved_ellipsoids(start_b.ellipsoids[new], found.b_from_a)
    state = _core.State(poses, np.concatenate([start_a.ellipsoids, moved]))
    estimate, summary = solve(graph, options, start=state)
    marginals = marginal_covariances(graph, estimate, options)
    return JointMap(graph, estimate, marginals, summary, found, merged_ids, shift)


def _more_pairs(
    joint: JointMap, a: Graph, b: Graph, pairs: Ints, refuted: Ints, options: _core.SolveOptions
) -> Ints:
    """Return rows of A and of B, (p, 2), of objects that the solution takes to one place.

    They are of one class, not further apart than their joint covariance allows, and no other
    object of the class is a candidate for either.
    """
    known, estimate = joint.graph.object_ids, joint.estimate
    row_in_joint = np.searchsorted(known, joint.merged_ids)
    alone_a = np.setdiff1d(np.arange(len(a.object_ids)), pairs[:, 0])
    alone_b = np.setdiff1d(np.arange(len(b.object_ids)), pairs[:, 1])
    mapped = np.isin(known, estimate.object_ids)
    alone_a, alone_b = alone_a[mapped[alone_a]], alone_b[mapped[row_in_joint[alone_b]]]
    landmarks = np.full((len(known), 9), np.nan)
    landmarks[mapped] = estimate.ellipsoids
    kept = Graph(
        only_objects(joint.graph.core, mapped),
        joint.graph.timestamps,
        known[mapped],
        estimate.class_names,
        joint.graph.observations[mapped],
    )
    state = _core.State(estimate.poses, estimate.ellipsoids)
    row_kept = np.cumsum(mapped) - 1
    candidates: list[tuple[int, int]] = []
    for row in alone_a.tolist():
        for other in alone_b.tolist():
            is_refuted = (refuted == [row, other]).all(axis=1).any()
            if is_refuted or a.class_names[row] != b.class_names[other]:
                continue
            there = int(row_in_joint[other])
            apart = landmarks[row] - landmarks[there]
            spread = joint.marginals.centers[[row_kept[row], row_kept[there]]]
            # Correlated or not, the variance of a difference is at most twice the sum of both.
            if apart[:3] @ np.linalg.solve(2.0 * spread.sum(axis=0), apart[:3]) > ONE_PLACE_CHI2:
                continue
            rows = [int(row_kept[row]), int(row_kept[there])]
            both = _core.joint_covariance(kept.core, options, state, [], rows)
            own, cross = both[:9, :9] + both[9:, 9:], both[:9, 9:]
            covariance = own - cross - cross.T
            if _fits(apart, covariance, landmarks[[row, there]]):
                candidates.append((row, other))
    table = np.array(candidates, dtype=np.int64).reshape(-1, 2)
    single = [np.unique(side, return_counts=True) for side in table.T]
    once = [values[counts == 1] for values, counts in single]
    return table[np.isin(table[:, 0], once[0]) & np.isin(table[:, 1], once[1])]


def _fits(apart: Floats, covariance: Floats, ellipsoids: Floats) -> bool:
    """Return whether two ellipsoids (2, 9) are one, from their difference and its covariance."""
    chi2 = apart[:3] @ np.linalg.solve(covariance[:3, :3], apart[:3])
    axes = np.array([_core.axes_from_ellipsoid(one)[1] for one in ellipsoids])
    # Nothing is farther from itself than it is large.
    near = np.linalg.norm(apart[:3]) < axes[:, 0].sum()
    return bool(near and chi2 < ONE_PLACE_CHI2)


def time_shift(end: float, begin: float) -> float:
    """Return what is added to the times of a recording so that it begins after the end of another.

    Seconds; 0 if it does.
    """
    return end + _GAP_S - begin if begin <= end else 0.0


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


def _rows(a: Graph, b: Graph, pairs: Ints) -> tuple[Ints, Ints]:
    """Return the row and the id in the joint problem of each object of B, (o,)."""
    row_of_b = np.full(len(b.object_ids), -1)
    row_of_b[pairs[:, 1]] = pairs[:, 0]
    alone = np.flatnonzero(row_of_b < 0)
    row_of_b[alone] = len(a.object_ids) + np.arange(len(alone))
    ids = np.concatenate([a.object_ids, a.object_ids.max() + 1 + np.arange(len(alone))])
    return row_of_b, ids[row_of_b]
