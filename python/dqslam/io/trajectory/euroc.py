"""EuRoC (ASL) trajectories: CSV lines ``t, px, py, pz, qw, qx, qy, qz``, more columns ignored.

Time is a whole number of nanoseconds, the quaternion has w first, and the pose is world_from_body,
where EuRoC's body is the IMU (``R_S``: sensor in reference frame). The camera is assumed to be the
body unless ``body_from_camera`` is given to read_trajectory. The header is a comment; if it names
all these columns, it tells their order and the unit of time.
Seconds as floats hold today's time to 0.24 microseconds, so nanoseconds are not kept exactly.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam.io.files import FileError, read_rows, write_text
from dqslam.io.formats import Format, Look, ReadContext, look_at
from dqslam.io.trajectory.columns import read_columns
from dqslam.io.trajectory.header import find_header
from dqslam.io.trajectory.table import Trajectory, make_trajectory, parse_columns

FIELDS = ("p_x", "p_y", "p_z", "q_w", "q_x", "q_y", "q_z")
HEADER = "#timestamp [ns]," + ",".join(FIELDS) + "\n"
NANO = Decimal(10) ** 9
SECOND = 10**9  #: a smaller number is not a time in nanoseconds, but the number of a frame
LONGEST = 20  #: more digits are no time
COMMONEST = (8, 17)  #: columns: the pose alone, and with velocity and biases


def read_euroc(path: str | Path, context: ReadContext) -> Trajectory:
    """Read an EuRoC trajectory of a body; it has times, so those of frames are not used."""
    look = look_at(path)
    if find_header(look.comments, look.first) is not None:
        return read_columns(path, context)
    rows, lines = read_rows(path)
    cells = [[cell.strip() for cell in row.split(",")] for row in rows]
    for row, line in zip(cells, lines, strict=True):
        if len(row) < 1 + len(FIELDS) or len(row) != len(cells[0]):
            message = f"{len(row)} fields, not 8 or more alike: t,{','.join(FIELDS)}"
            raise FileError(path, message, line)
    times = np.array([_seconds(path, row[0], line) for row, line in zip(cells, lines, strict=True)])
    table = parse_columns(path, FIELDS, [row[1:8] for row in cells], lines)
    poses = table[:, [0, 1, 2, 4, 5, 6, 3]]
    return make_trajectory(path, times, poses, lines, context)


def write_euroc(path: str | Path, timestamps: ArrayLike, world_from_camera: ArrayLike) -> None:
    """Write poses (n, 7) at times (n,) as EuRoC CSV."""
    times = np.asarray(timestamps, dtype=float).tolist()
    poses = np.asarray(world_from_camera, dtype=float)[:, [0, 1, 2, 6, 3, 4, 5]].tolist()
    rows = (
        f"{int((Decimal(repr(time)) * NANO).to_integral_value())},"
        + ",".join(f"{value:.9f}" for value in pose)
        + "\n"
        for time, pose in zip(times, poses, strict=True)
    )
    write_text(path, [HEADER, *rows])


def _seconds(path: str | Path, cell: str, line: int) -> float:
    # A float of nanoseconds would lose 7 bits before it is divided.
    if not cell.lstrip("-").isdecimal() or len(cell) > LONGEST:
        raise FileError(path, f"time is {cell!r}, not a whole number of nanoseconds", line)
    return float(Decimal(cell) / NANO)


def _looks(look: Look) -> bool:
    cells = [cell.strip() for cell in look.first.split(",")]
    is_time = cells[0].isdecimal() and len(cells[0]) < LONGEST and int(cells[0]) >= SECOND
    return len(cells) in COMMONEST and is_time


EUROC = Format(
    "euroc",
    "CSV of nanoseconds, position, quaternion w first",
    _looks,
    read_euroc,
    write_euroc,
    endings=(".csv",),
)
