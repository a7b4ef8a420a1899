"""A trajectory in memory, and the checks that all formats share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dqslam._limits import IN_REACH, LARGEST_COORDINATE_M
from dqslam.io.files import FileError, in_reach, parse_floats
from dqslam.io.formats import ReadContext

# Files may round quaternions to 4 digits, which changes the norm by up to 1e-4; more is a mistake.
NORM_TOLERANCE = 1e-3
# The error of nine decimals; a quaternion with a smaller error is not normalized.
ROUNDING = 2e-9
NAMES = ("t", "tx", "ty", "tz", "qx", "qy", "qz", "qw")


class Trajectory(NamedTuple):
    """A path: ``timestamps`` (n,) s, increasing, and ``world_from_camera`` (n, 7) m, x y z w."""

    timestamps: NDArray[np.float64]
    world_from_camera: NDArray[np.float64]


def parse_columns(
    path: str | Path, names: Sequence[str], rows: Sequence[Sequence[str]], lines: Sequence[int]
) -> NDArray[np.float64]:
    """Turn rows with one cell for each name into numbers, shape (n, names), NaN among them."""
    columns = zip(names, zip(*rows, strict=True), strict=True)
    return np.column_stack([parse_floats(path, name, cells, lines) for name, cells in columns])


def make_trajectory(
    path: str | Path,
    times: NDArray[np.float64],
    poses: NDArray[np.float64],
    lines: Sequence[int],
    context: ReadContext,
) -> Trajectory:
    """Check times (n,) and poses (n, 7) from these lines of a file, and normalize quaternions.

    Poses that are not finite, as where tracking was lost, and repeated ones are left out and noted,
    a few of them.
    """
    line_numbers = np.array(lines)
    keep = _finite(path, times, poses, line_numbers, context)
    times, poses, line_numbers = times[keep], poses[keep], line_numbers[keep]
    keep = _new(path, times, poses, line_numbers, context)
    times, poses, line_numbers = times[keep], poses[keep], line_numbers[keep]
    _check_times(path, times, line_numbers)
    far = np.flatnonzero(np.abs(poses[:, :3]).max(axis=1) > LARGEST_COORDINATE_M)
    if far.size:
        message = f"position is further than {LARGEST_COORDINATE_M:g} m from the origin"
        raise FileError(path, message, int(line_numbers[far[0]]))
    return Trajectory(times, _normalized(path, poses, line_numbers))


def _finite(
    path: str | Path,
    times: NDArray[np.float64],
    poses: NDArray[np.float64],
    lines: NDArray[np.int64],
    context: ReadContext,
) -> NDArray[np.bool_]:
    """Return which poses are finite and have a rotation, and note the others."""
    cells = np.column_stack([times, poses])
    good = ~np.isnan(in_reach(cells))
    finite = np.asarray(good.all(axis=1))
    # Programs that lost track also write a quaternion of zeros.
    bad: NDArray[np.bool_] = ~finite | np.all(poses[:, 3:] == 0, axis=1)

    def error(row: int) -> FileError:
        if finite[row]:
            return FileError(path, "quaternion has length 0, not 1", int(lines[row]))
        column = int(np.flatnonzero(~good[row])[0])
        return FileError(path, f"{NAMES[column]} is not {IN_REACH}", int(lines[row]))

    rows = np.flatnonzero(bad).tolist()
    context.notes.leave_out(path, "poses", "no pose", rows, len(cells), error)
    return ~bad


def _new(
    path: str | Path,
    times: NDArray[np.float64],
    poses: NDArray[np.float64],
    lines: NDArray[np.int64],
    context: ReadContext,
) -> NDArray[np.bool_]:
    """Return which poses do not repeat the time of the one before, and note the others.

    Another pose at the same time is a contradiction, unless ``repeated_times`` allows it.
    """
    again = np.concatenate([[False], times[1:] == times[:-1]])
    if context.repeated_times or not again.any():
        return ~again
    same = np.concatenate([[False], (poses[1:] == poses[:-1]).all(axis=1)])
    repeated: NDArray[np.bool_] = again & same

    def error(row: int) -> FileError:
        message = f"time {times[row].item()!r} repeats {times[row - 1].item()!r}"
        return FileError(path, f"{message} (line {lines[row - 1]})", int(lines[row]))

    rows = np.flatnonzero(repeated).tolist()
    context.notes.leave_out(path, "poses", "repeated", rows, len(times), error)
    return ~repeated


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
    bad = np.flatnonzero(~(np.abs(norm - 1) <= NORM_TOLERANCE))
    if bad.size:
        i = bad[0]
        raise FileError(path, f"quaternion has length {norm[i]:.6g}, not 1", int(lines[i]))
    divisor = np.where(np.abs(norm - 1) > ROUNDING, norm, 1.0)
    return np.column_stack([poses[:, :3], poses[:, 3:] / divisor[:, None]])
