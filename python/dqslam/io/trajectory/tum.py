"""TUM trajectories: one line ``t tx ty tz qx qy qz qw`` for each pose.

The pose is world_from_camera: meters, unit quaternion x y z w, camera x right, y down, z forward.
Time is in seconds and strictly increasing. Lines that start with # are comments.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam.io.files import FileError, read_rows, write_text
from dqslam.io.formats import Format, Look
from dqslam.io.frames import FrameTimes
from dqslam.io.trajectory.table import Trajectory, make_trajectory, parse_columns

FIELDS = ("t", "tx", "ty", "tz", "qx", "qy", "qz", "qw")


def read_tum(
    path: str | Path, *, frames: FrameTimes | None = None, repeated_times: bool = False
) -> Trajectory:
    """Read a TUM trajectory; ``frames`` are not used, because it has times."""
    rows, lines = read_rows(path)
    fields = [row.split() for row in rows]
    for row, line in zip(fields, lines, strict=True):
        if len(row) != len(FIELDS):
            raise FileError(path, f"{len(row)} fields, not 8: {' '.join(FIELDS)}", line)
    table = parse_columns(path, FIELDS, fields, lines)
    return make_trajectory(path, table[:, 0], table[:, 1:], lines, repeated_times=repeated_times)


def write_tum(path: str | Path, timestamps: ArrayLike, world_from_camera: ArrayLike) -> None:
    """Write poses (n, 7) at times (n,) as TUM text; times are written without loss of a bit."""
    times = np.asarray(timestamps, dtype=float).tolist()
    poses = np.asarray(world_from_camera, dtype=float).tolist()
    write_text(
        path,
        (
            f"{time!r} " + " ".join(f"{value:.9f}" for value in pose) + "\n"
            for time, pose in zip(times, poses, strict=True)
        ),
    )


def _looks(look: Look) -> bool:
    fields = look.first.split()
    # A camera of COLMAP may have 8 fields as well; its second field is the model.
    return "," not in look.first and len(fields) == len(FIELDS) and not fields[1][0].isupper()


TUM = Format(
    "tum",
    "8 fields a line, t tx ty tz qx qy qz qw",
    _looks,
    read_tum,
    write_tum,
    endings=(".txt", ".tum"),
)
