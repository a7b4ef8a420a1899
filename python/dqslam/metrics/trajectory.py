"""Absolute and relative errors of a trajectory."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from dqslam._checks import Floats, Ints, as_floats
from dqslam.metrics.alignment import Align, Alignment, align_positions, same_shape

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class Statistics:
    """Statistics of errors, in the unit of the errors."""

    rmse: float
    """Root mean square."""
    mean: float
    median: float
    max: float


def statistics(errors: Floats) -> Statistics:
    """Summarize errors, shape (n,), n at least 1."""
    return Statistics(
        rmse=float(np.sqrt(np.mean(errors**2))),
        mean=float(errors.mean()),
        median=float(np.median(errors)),
        max=float(errors.max()),
    )


@dataclass(frozen=True, eq=False)
class TrajectoryError:
    """Distances between two trajectories after alignment, meters."""

    mean: float
    rmse: float
    """Root mean square, which most tools call the absolute trajectory error."""
    median: float
    max: float
    alignment: Alignment
    """The motion true_from_estimated, in three dimensions for every kind of alignment."""

    def __str__(self) -> str:
        """Show all on one line."""
        return (
            f"mean {self.mean:.4f} m, rmse {self.rmse:.4f} m, "
            f"median {self.median:.4f} m, max {self.max:.4f} m"
        )


def absolute_trajectory_error(
    positions: Floats, true_positions: Floats, *, align: Align = "se3"
) -> TrajectoryError:
    """Compare positions with true ones, shape (n, 3) [m], row by row.

    The best motion of the kind ``align`` is removed first, see ``align_positions``.
    """
    alignment = align_positions(positions, true_positions, align)
    positions, true_positions = same_shape(positions, true_positions)
    found = statistics(np.linalg.norm(alignment.apply(positions) - true_positions, axis=1))
    return TrajectoryError(found.mean, found.rmse, found.median, found.max, alignment)


@dataclass(frozen=True)
class RelativePoseError:
    """Errors of the motions between pairs of poses."""

    pairs: int
    translation: Statistics
    """Errors of the translation, meters."""
    rotation_deg: Statistics
    """Errors of the rotation, degrees."""


def relative_pose_error(
    poses: Floats,
    true_poses: Floats,
    *,
    delta: float = 1.0,
    unit: Literal["frames", "meters"] = "frames",
    all_pairs: bool = True,
) -> RelativePoseError:
    """Compare the motions over a distance: (Q_i^-1 Q_j)^-1 (P_i^-1 P_j), Q true, P estimated.

    A rigid motion between the two worlds has no effect.

    Parameters
    ----------
    poses, true_poses
        world_from_camera, shape (n, 7), row by row.
    delta, unit
        j is ``delta`` frames after i, or the first pose at which the true path is ``delta``
        meters longer.
    all_pairs
        Whether a pair starts at every pose; otherwise each starts where the one before ends.

    Raises
    ------
    ValueError
        If the trajectory is too short for one pair.
    """
    poses = as_floats("poses", poses, [None, 7])
    true_poses = as_floats("true poses", true_poses, [None, 7])
    same_shape(poses, true_poses)
    first, last = _pairs(true_poses[:, :3], delta, unit, all_pairs)
    if not len(first):
        raise ValueError(f"relative pose error: no two poses are {delta:g} {unit} apart")
    step, turn = _motion(poses, first, last)
    true_step, true_turn = _motion(true_poses, first, last)
    distance = np.linalg.norm(step - true_step, axis=1)  # a rotation changes no length
    angle = np.degrees((true_turn.inv() * turn).magnitude())
    return RelativePoseError(len(first), statistics(distance), statistics(angle))


def _motion(poses: Floats, first: Ints, last: Ints) -> "tuple[Floats, Rotation]":
    """Return last_in_first: positions, shape (p, 3), and rotations."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_quat(poses[:, 3:])
    back = turns[first].inv()
    return back.apply(poses[last, :3] - poses[first, :3]), back * turns[last]


def _pairs(true_points: Floats, delta: float, unit: str, all_pairs: bool) -> tuple[Ints, Ints]:
    """Return the rows of the first and the last pose of each pair, shape (p,)."""
    count = len(true_points)
    if not (np.isfinite(delta) and delta > 0.0):
        raise ValueError(f"delta: expected a positive number, got {delta:g}")
    if unit == "frames":
        if delta != round(delta):
            raise ValueError(f"delta: expected a whole number of frames, got {delta:g}")
        after = np.arange(count) + int(delta)
    elif unit == "meters":
        steps = np.linalg.norm(np.diff(true_points, axis=0), axis=1)
        path = np.concatenate([[0.0], np.cumsum(steps)])
        after = np.searchsorted(path, path + delta, side="left")
    else:
        raise ValueError(f'unit: expected "frames" or "meters", got {unit!r}')
    first = np.flatnonzero(after < count)
    if not all_pairs:
        chain, row = [], 0
        while after[row] < count:
            chain.append(row)
            row = int(after[row])
        first = np.array(chain, dtype=np.int64)
    return first, after[first]
