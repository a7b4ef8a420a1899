"""Measurements other than odometry and boxes, as CSV: columns by name, # starts a comment line.

Positions of objects
    ``pose`` or ``timestamp``, ``object``, ``x y z``: the center of the object in the camera frame
    [m]. ``object`` is the id of the object in the column of ids of the boxes.
Absolute positions
    ``pose`` or ``timestamp``, ``x y z``: the position of the camera in a frame of its own [m].
Loop closures
    ``from_pose to_pose`` or ``from_timestamp to_timestamp``, ``x y z qx qy qz qw``: the pose of the
    camera at the second in the frame of the first [m].

``pose`` counts the poses of the trajectory from 0, and a time belongs to the nearest one. Of the
covariance there is the upper triangle, ``c11 c12 c13 c22 c23 c33`` [m^2], or ``sigma`` [m]. Of a
closure it is that of x y z, then of the rotation vector, in the frame of the second pose, ``c11``
to ``c66`` [m, rad], or ``sigma_translation`` [m] and ``sigma_rotation`` [rad].
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.io.csv_table import CsvTable, read_csv
from dqslam.io.files import FileError
from dqslam.io.nearest import nearest_pose
from dqslam.recording import AbsolutePositions, LoopClosures, RelativePositions

POSITION = ("x", "y", "z")
QUATERNION = ("qx", "qy", "qz", "qw")
_UNIT = 1e-3


def read_positions(
    path: str | Path,
    timestamps: Floats,
    max_time_difference: float | None = None,
    counted: Ints | None = None,
) -> RelativePositions:
    """Read positions of objects in the camera frame at poses of these times (n,).

    ``max_time_difference`` is the most seconds from a measurement to its pose, by default half the
    median interval of poses. ``counted`` (k,) are the rows of the poses that the column ``pose``
    counts, by default all.

    Raises
    ------
    FileError
        If a column is missing, a pose does not exist, or a covariance is not positive definite.
    """
    table = read_csv(path, required=("object", *POSITION))
    object_id = table.integers("object")
    table.reject(object_id < 0, "object is {}, not an id", "object")
    return RelativePositions(
        pose=_poses(table, "", timestamps, max_time_difference, counted),
        object_id=object_id,
        object_in_robot=_columns(table, POSITION),
        covariance=_covariances(table, 3, (("sigma", 3),)),
    )


def read_absolute(
    path: str | Path,
    timestamps: Floats,
    max_time_difference: float | None = None,
    counted: Ints | None = None,
) -> AbsolutePositions:
    """Read absolute positions of the camera; parameters and errors are those of read_positions."""
    table = read_csv(path, required=POSITION)
    return AbsolutePositions(
        pose=_poses(table, "", timestamps, max_time_difference, counted),
        position=_columns(table, POSITION),
        covariance=_covariances(table, 3, (("sigma", 3),)),
    )


def read_closures(
    path: str | Path,
    timestamps: Floats,
    max_time_difference: float | None = None,
    counted: Ints | None = None,
) -> LoopClosures:
    """Read loop closures; parameters and errors are those of read_positions."""
    table = read_csv(path, required=(*POSITION, *QUATERNION))
    from_pose = _poses(table, "from_", timestamps, max_time_difference, counted)
    to_pose = _poses(table, "to_", timestamps, max_time_difference, counted)
    table.reject(from_pose == to_pose, "both ends are of the same pose")
    quaternion = _columns(table, QUATERNION)
    norm = np.linalg.norm(quaternion, axis=1)
    table.reject(np.abs(norm - 1) > _UNIT, "the quaternion is not of length 1")
    relative = np.column_stack([_columns(table, POSITION), quaternion / norm[:, None]])
    covariance = _covariances(table, 6, (("sigma_translation", 3), ("sigma_rotation", 3)))
    return LoopClosures(from_pose, to_pose, relative, covariance)


def _poses(
    table: CsvTable,
    prefix: str,
    timestamps: Floats,
    max_time_difference: float | None,
    counted: Ints | None,
) -> Ints:
    pose, time = f"{prefix}pose", f"{prefix}timestamp"
    if (pose in table) == (time in table):
        which = "both" if pose in table else "none"
        header = table.lines[0] - 1
        raise FileError(table.path, f"needs a column {pose} or {time}, has {which}", header)
    if pose in table:
        rows = table.integers(pose)
        count = len(timestamps) if counted is None else len(counted)
        outside = (rows < 0) | (rows >= count)
        table.reject(outside, f"{pose} is {{}}, but there are {count} poses, from 0", pose)
        return rows if counted is None else counted[rows]
    rows, late = nearest_pose(timestamps, table.numbers(time))
    tolerance = max_time_difference
    if tolerance is None:
        tolerance = 0.5 * float(np.median(np.diff(timestamps)))
    span = f"{timestamps[0]:.6f} to {timestamps[-1]:.6f} s"
    message = f"{time} is {{}}, further than {tolerance:g} s from a pose ({span})"
    table.reject(late > tolerance, message, time)
    return rows


def _columns(table: CsvTable, names: Sequence[str]) -> Floats:
    return np.column_stack([table.numbers(name) for name in names])


def _covariances(table: CsvTable, size: int, sigmas: Sequence[tuple[str, int]]) -> Floats:
    """Return covariances (m, size, size) of an upper triangle, or of sigmas of so many axes."""
    rows, columns = np.triu_indices(size)
    upper = [f"c{row + 1}{column + 1}" for row, column in zip(rows, columns, strict=True)]
    names = [name for name, _ in sigmas]
    has_upper, has_sigmas = upper[0] in table, names[0] in table
    if has_upper == has_sigmas:
        which = "both" if has_upper else "neither"
        message = f"needs {upper[0]} to {upper[-1]}, or {' and '.join(names)}; has {which}"
        raise FileError(table.path, message, table.lines[0] - 1)
    missing = [name for name in (upper if has_upper else names) if name not in table]
    if missing:
        raise FileError(table.path, f"no column {', '.join(missing)}", table.lines[0] - 1)
    if has_sigmas:
        for name in names:
            table.reject(table.numbers(name) <= 0, f"{name} is {{}}, not positive", name)
        sigma = np.column_stack([np.tile(table.numbers(name), (n, 1)).T for name, n in sigmas])
        return np.asarray(sigma[:, :, None] ** 2 * np.eye(size))
    matrix = np.zeros((len(table), size, size))
    matrix[:, rows, columns] = matrix[:, columns, rows] = _columns(table, upper)
    scale = np.sqrt(np.abs(np.diagonal(matrix, axis1=1, axis2=2)).clip(min=1e-300))
    least = np.linalg.eigvalsh(matrix / scale[:, :, None] / scale[:, None, :])[:, 0]
    table.reject(least <= 0, "the covariance is not positive definite")
    return matrix
