"""What has changed between two maps of one place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dqslam._checks import Floats, as_covariances, as_floats
from dqslam._repr import counted
from dqslam.io import Results
from dqslam.io.results import load_map_results
from dqslam.places.changes.frames import find_frame, frame_covariance
from dqslam.places.changes.matching import CENTER_M, CENTER_SHARE, Assignment, match_maps
from dqslam.places.changes.seen_map import SeenMap

Status = Literal["stayed", "moved", "vanished", "appeared", "unknown"]
STATUSES: tuple[Status, ...] = ("stayed", "moved", "vanished", "appeared", "unknown")

# Rounds in which the frames are fitted by the objects that stayed.
_ROUNDS = 4
# The least probability of a change; below, it is not told from an object that was overlooked.
MIN_PROBABILITY = 0.7


@dataclass(frozen=True, eq=False)
class Change:
    """What became of an object, or of two rows that are one object."""

    status: Status
    """"unknown" if it is missing in one map, and the cameras of that map would probably have missed
    it at its place."""
    probability: float
    """That the status is right; for "unknown", that the object is still there."""
    first_id: int | None
    """Id in the first map, None if it is not in it."""
    second_id: int | None
    """Id in the second map, None if it is not in it."""
    class_name: str
    first_center: Floats | None
    """Meters in the frame of the second map, shape (3,); None if it is not in the first map."""
    second_center: Floats | None
    """Meters, shape (3,); None if it is not in the second map."""
    displacement: Floats | None
    """From the first to the second center, meters, shape (3,)."""
    covariance: Floats | None
    """Of the displacement, square meters, with the error of the frames, shape (3, 3)."""
    significance: float | None
    """Probability of a displacement at least as large by errors alone (chi-square)."""
    size: float
    """Mean semi-axis, meters."""
    looks: float
    """Boxes that the object should have had in the map that lacks it; in the second map, if it is
    in both."""


@dataclass(frozen=True, eq=False)
class Changes:
    """All objects of two maps."""

    objects: tuple[Change, ...]
    """Those of the first map in its order, then those that are only in the second."""
    second_from_first: Floats
    """Pose that was used, fitted by the objects that stayed, shape (4, 4)."""
    cameras: Floats
    """Poses of the images of the second map, world_from_camera, shape (n, 7)."""
    frame: str = ""
    """How the frames were found, if that was asked for."""

    def of(self, status: Status) -> tuple[Change, ...]:
        """Return the objects of a status."""
        return tuple(one for one in self.objects if one.status == status)

    def __repr__(self) -> str:
        """Show how many objects have each status."""
        counts = [f"{len(self.of(status))} {status}" for status in STATUSES if self.of(status)]
        return f"Changes({counted(len(self.objects), 'object')}: {', '.join(counts)})"


def changes(
    first: Results | str | Path,
    second: Results | str | Path,
    *,
    second_from_first: ArrayLike | Literal["find"] | None = None,
    covariance: ArrayLike | None = None,
) -> Changes:
    """Tell which objects stayed, moved, vanished or appeared, or that nobody looked.

    Parameters
    ----------
    first, second
        Two maps with the boxes that they were made from: results or their folders.
    second_from_first
        Pose of the first map in the frame of the second, shape (4, 4); by default, both have one
        frame. ``"find"`` looks at the objects: either they are where they were in one frame, or
        both maps are aligned, see ``align``; ``Changes.frame`` says which.
    covariance
        Of that pose: translation [m], then rotation [rad], in the frame of the second map, shape
        (6, 6); by default that of 5 cm and 0.02 rad.

    Raises
    ------
    ValueError
        If the pose or the covariance is none, or a map has no ellipsoid.
    CannotTellError
        If the motion between the frames is to be found, and the objects do not say it.
    FileError
        If a folder has no results.

    Examples
    --------
    Two maps of one drive; nothing has changed:

    >>> import dqslam as dq
    >>> recording, truth = dq.simulate(dq.load_scenario("orbit"), seed=1)
    >>> graph = dq.build_graph(recording)
    >>> estimate, summary = dq.solve(graph)
    >>> marginals = dq.marginal_covariances(graph, estimate)
    >>> kept = {"detections": recording.detections, "marginals": marginals}
    >>> dq.save_estimate(estimate, "results/monday", **kept)
    >>> dq.save_estimate(estimate, "results/tuesday", **kept)
    >>> found = dq.changes("results/monday", "results/tuesday")
    >>> {one.status for one in found.objects}
    {'stayed'}
    """
    from scipy.spatial.transform import Rotation

    before, after = _results(first), _results(second)
    unmoved, spread, told = _pose(None), frame_covariance(), ""
    other = SeenMap.of(after, unmoved)
    if isinstance(second_from_first, str):
        if second_from_first != "find" or covariance is not None:
            raise ValueError('second_from_first: a matrix, None, or "find" without a covariance')
        wide = _with_frame_error(SeenMap.of(before, unmoved), spread)
        second_from_first, spread, told = find_frame(before, after, wide, other)
    if covariance is not None:
        spread = as_covariances("covariance", np.asarray(covariance)[None], 1, 6)[0]
    pose = _pose(second_from_first)
    pose, spread = _fit_frames(before, other, pose, spread)
    one = _with_frame_error(SeenMap.of(before, pose), spread)
    looks_after, looks_before = other.looks_at(one), one.looks_at(other)
    found = match_maps(one, other, looks_after, looks_before)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = Rotation.from_quat(pose[3:]).as_matrix(), pose[:3]
    objects = tuple(_described(one, other, found, looks_after, looks_before))
    return Changes(objects, matrix, other.poses, told)


def _results(source: Results | str | Path) -> Results:
    return source if isinstance(source, Results) else load_map_results(source)


def _pose(second_from_first: ArrayLike | None) -> Floats:
    from scipy.spatial.transform import Rotation

    if second_from_first is None:
        return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    matrix = as_floats("second_from_first", second_from_first, [4, 4])
    turn = matrix[:3, :3]
    is_turn = np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0.0
    if not is_turn or not np.allclose(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError("second_from_first: not a rotation, a translation and the row 0 0 0 1")
    return np.concatenate([matrix[:3, 3], Rotation.from_matrix(turn).as_quat()])


def _fit_frames(
    before: Results, other: SeenMap, pose: Floats, prior: Floats
) -> tuple[Floats, Floats]:
    """Fit the pose (7,) of the first map by the objects that stayed; also return its covariance.

    What is given is the prior, so that few objects change little.
    """
    from scipy.spatial.transform import Rotation

    information = np.linalg.inv(prior)
    start, spread = pose, prior
    for _ in range(_ROUNDS):
        one = SeenMap.of(before, pose)
        wide = _with_frame_error(one, spread)
        unseen = np.zeros(len(one)), np.zeros(len(other))
        found = match_maps(wide, other, *unseen)
        rows = np.flatnonzero((found.second >= 0) & (found.stayed > 0.5))
        hessian, gradient = information.copy(), information @ _minus(pose, start)
        for row in rows.tolist():
            at, other_row = one.centers[row], int(found.second[row])
            jacobian = _by_frame(at)
            own = _pair_covariance(one, other, row, other_row)
            error = at - other.centers[other_row]
            chi2 = error @ np.linalg.solve(own, error)
            weight = found.stayed[row] / (1.0 + chi2 / 9.0)
            weighted = weight * jacobian.T @ np.linalg.inv(own)
            hessian += weighted @ jacobian
            gradient += weighted @ error
        spread = np.linalg.inv(hessian)
        step = -spread @ gradient
        turn = Rotation.from_rotvec(step[3:])
        pose = np.concatenate(
            [turn.apply(pose[:3]) + step[:3], (turn * Rotation.from_quat(pose[3:])).as_quat()]
        )
    return pose, spread


def _minus(pose: Floats, start: Floats) -> Floats:
    """Return translation and rotation vector that move a pose to another, in the common frame."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(pose[3:]) * Rotation.from_quat(start[3:]).inv()
    return np.concatenate([pose[:3] - turn.apply(start[:3]), turn.as_rotvec()])


def _by_frame(point: Floats) -> Floats:
    """Return the derivative (3, 6) of a point by translation and rotation of its frame."""
    x, y, z = point
    return np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])


def _with_frame_error(one: SeenMap, spread: Floats) -> SeenMap:
    """Add the error of the frame (6, 6) to the covariances of the centers."""
    jacobians = np.array([_by_frame(center) for center in one.centers]).reshape(-1, 3, 6)
    more = jacobians @ spread @ jacobians.transpose(0, 2, 1)
    return replace(one, center_covariances=one.center_covariances + more)


def _pair_covariance(one: SeenMap, other: SeenMap, row: int, other_row: int) -> Floats:
    """Return the covariance (3, 3) of the difference of two centers of one object."""
    size = float(np.exp(one.log_size[row, 0]))
    blur = (CENTER_SHARE * size) ** 2 + CENTER_M**2
    total = one.center_covariances[row] + other.center_covariances[other_row]
    return np.asarray(total + blur * np.eye(3))


def _described(
    one: SeenMap, other: SeenMap, found: Assignment, looks_after: Floats, looks_before: Floats
) -> Sequence[Change]:
    rows = [_first_change(one, other, found, row, looks_after) for row in range(len(one))]
    alone = np.setdiff1d(np.arange(len(other)), found.second)
    for row in alone.tolist():
        probability = float(found.appeared[row])
        is_new = probability >= MIN_PROBABILITY
        rows.append(
            Change(
                status="appeared" if is_new else "unknown",
                probability=probability if is_new else 1.0 - probability,
                first_id=None,
                second_id=int(other.object_ids[row]),
                class_name=other.class_names[row],
                first_center=None,
                second_center=other.centers[row],
                displacement=None,
                covariance=None,
                significance=None,
                size=float(np.exp(other.log_size[row, 0])),
                looks=float(looks_before[row]),
            )
        )
    return rows


def _first_change(
    one: SeenMap, other: SeenMap, found: Assignment, row: int, looks: Floats
) -> Change:
    from scipy.stats import chi2 as chi2_distribution

    match, size = int(found.second[row]), float(np.exp(one.log_size[row, 0]))
    stayed, moved, vanished = (
        float(part[row]) for part in (found.stayed, found.moved, found.vanished)
    )
    if match < 0:
        is_gone = vanished >= MIN_PROBABILITY
        status: Status = "vanished" if is_gone else "unknown"
        probability = vanished if is_gone else 1.0 - vanished
        return Change(
            status,
            probability,
            int(one.object_ids[row]),
            None,
            one.class_names[row],
            one.centers[row],
            None,
            None,
            None,
            None,
            size,
            float(looks[row]),
        )
    displacement = other.centers[match] - one.centers[row]
    covariance = _pair_covariance(one, other, row, match)
    chi2 = float(displacement @ np.linalg.solve(covariance, displacement))
    is_moved = moved > stayed
    return Change(
        status="moved" if is_moved else "stayed",
        probability=moved if is_moved else stayed,
        first_id=int(one.object_ids[row]),
        second_id=int(other.object_ids[match]),
        class_name=one.class_names[row],
        first_center=one.centers[row],
        second_center=other.centers[match],
        displacement=displacement,
        covariance=covariance,
        significance=float(chi2_distribution.sf(chi2, 3)),
        size=size,
        looks=float(looks[row]),
    )
