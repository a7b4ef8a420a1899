"""A trajectory in memory, and the checks that all formats share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dqslam.io.files import FileError, parse_numbers

# Files may round quaternions to 4 digits, which changes the norm by up to 1e-4; more is a mistake.
NORM_TOLERANCE = 1e-3
# The error of nine decimals; a quaternion with a smaller error is not normalized.
ROUNDING = 2e-9

# A larger coordinate is in another unit or column; no place on Earth has it, in any frame.
LARGEST_COORDINATE = 1e8


class Trajectory(NamedTuple):
    """A path: ``timestamps`` (n,) s, increasing, and ``world_from_camera`` (n, 7) m, x y z w."""

    timestamps: NDArray[np.float64]
    world_from_camera: NDArray[np.float64]


def parse_columns(
    path: str | Path, names: Sequence[str], rows: Sequence[Sequence[str]], lines: Sequence[int]
) -> NDArray[np.float64]:
    """Turn rows with one cell for each name into finite numbers, shape (n, names)."""
    columns = zip(names, zip(*rows, strict=True), strict=True)
    return np.column_stack([parse_numbers(path, name, cells, lines) for name, cells in columns])


def make_trajectory(
    path: str | Path,
    times: NDArray[np.float64],
    poses: NDArray[np.float64],
    lines: Sequence[int],
    *,
    repeated_times: bool,
) -> Trajectory:
    """Check times (n,) and poses (n, 7) from these lines of a file, and normalize quaternions."""
    line_numbers = np.array(lines)
    if repeated_times:
        keep = np.concatenate([[True], times[1:] != times[:-1]])
        times, poses, line_numbers = times[keep], poses[keep], line_numbers[keep]
    _check_times(path, times, line_numbers)
    far = np.flatnonzero(np.abs(poses[:, :3]).max(axis=1) > LARGEST_COORDINATE)
    if far.size:
        message = f"position is further than {LARGEST_COORDINATE:g} m from the origin"
        raise FileError(path, message, int(line_numbers[far[0]]))
    return Trajectory(times, _normalized(path, poses, line_numbers))


def _check_times(path: str | Path, times: NDArray[np.float64], lines: NDArray[np.int64]) -> None:
    late = np.flatnonzero(times[1:] <= times[:-1])
    if late.size:
        i = late[0]
        how = "repeats" if times[i + 1] == times[i] else "goes back from"
        message = f"time {times[i + 1].item()!r} {how} {times[i].item()!r} (line {lines[i]})"
        raise FileError(path, message, int(lines[i + 1]))


def _normalized(
    path: str | Path, poses: NDArray[np.float64], lines: NDArray[np.int64]
) -> NDArray[np.float64]:
    norm = np.linalg.norm(poses[:, 3:], axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > NORM_TOLERANCE)
    if bad.size:
        i = bad[0]
        raise FileError(path, f"quaternion has length {norm[i]:.6g}, not 1", int(lines[i]))
    divisor = np.where(np.abs(norm - 1) > ROUNDING, norm, 1.0)
    return np.column_stack([poses[:, :3], poses[:, 3:] / divisor[:, None]])
