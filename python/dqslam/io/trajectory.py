"""Trajectories as TUM text: one line ``t tx ty tz qx qy qz qw`` a pose.

The pose is world_from_camera: metres, unit quaternion x y z w, camera x right, y down, z forward.
Time is in seconds and strictly increasing. Lines that start with # are comments.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam.io.files import FileError, parse_numbers, read_rows, write_text

FIELDS = ("t", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
# Files round quaternions to 4 digits, which costs up to 1e-4 of the norm; more is a mistake.
NORM_TOLERANCE = 1e-3

# Beyond any place on Earth, in any frame: numbers of another unit, or of another column.
LARGEST_COORDINATE = 1e8


class Trajectory(NamedTuple):
    """A path: ``timestamps`` (n,) s, increasing, and ``world_from_camera`` (n, 7) m, x y z w."""

    timestamps: NDArray[np.float64]
    world_from_camera: NDArray[np.float64]


def read_trajectory(path: str | Path, *, repeated_times: bool = False) -> Trajectory:
    """Read a TUM trajectory.

    With ``repeated_times`` a time that comes again is left out instead of refused: motion capture
    at a high rate, rounded to its last digit, has a few.
    """
    rows, lines = read_rows(path)
    fields = [row.split() for row in rows]
    for row, line in zip(fields, lines, strict=True):
        if len(row) != len(FIELDS):
            raise FileError(path, f"{len(row)} fields, not 8: {' '.join(FIELDS)}", line)
    columns = zip(FIELDS, zip(*fields, strict=True), strict=True)
    table = np.column_stack([parse_numbers(path, name, cells, lines) for name, cells in columns])
    line_numbers = np.array(lines)
    if repeated_times:
        keep = np.concatenate([[True], table[1:, 0] != table[:-1, 0]])
        table, line_numbers = table[keep], line_numbers[keep]
    _check_times(path, table[:, 0], line_numbers)
    far = np.flatnonzero(np.abs(table[:, 1:4]).max(axis=1) > LARGEST_COORDINATE)
    if far.size:
        message = f"position is further than {LARGEST_COORDINATE:g} m from the origin"
        raise FileError(path, message, int(line_numbers[far[0]]))
    return Trajectory(table[:, 0], _normalised(path, table[:, 1:], line_numbers))


def write_trajectory(path: str | Path, timestamps: ArrayLike, world_from_camera: ArrayLike) -> None:
    """Write poses (n, 7) at times (n,) as TUM text; the times come back to the last bit."""
    times = np.asarray(timestamps, dtype=float).tolist()
    poses = np.asarray(world_from_camera, dtype=float).tolist()
    write_text(
        path,
        (
            f"{time!r} " + " ".join(f"{value:.9f}" for value in pose) + "\n"
            for time, pose in zip(times, poses, strict=True)
        ),
    )


def _check_times(path: str | Path, times: NDArray[np.float64], lines: NDArray[np.int64]) -> None:
    late = np.flatnonzero(times[1:] <= times[:-1])
    if late.size:
        i = late[0]
        how = "repeats" if times[i + 1] == times[i] else "goes back from"
        message = f"time {times[i + 1].item()!r} {how} {times[i].item()!r} (line {lines[i]})"
        raise FileError(path, message, int(lines[i + 1]))


def _normalised(
    path: str | Path, poses: NDArray[np.float64], lines: NDArray[np.int64]
) -> NDArray[np.float64]:
    norm = np.linalg.norm(poses[:, 3:], axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > NORM_TOLERANCE)
    if bad.size:
        i = bad[0]
        raise FileError(path, f"quaternion has length {norm[i]:.6g}, not 1", int(lines[i]))
    return np.column_stack([poses[:, :3], poses[:, 3:] / norm[:, None]])
