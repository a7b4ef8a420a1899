"""TUM trajectories: one line ``t tx ty tz qx qy qz qw`` for each pose.

The pose is world_from_camera: meters, unit quaternion x y z w, camera x right, y down, z forward.
Time is in seconds and strictly increasing. Lines that start with # are comments; if one of them, or
the first row, names the columns, it tells their order and more: see `columns`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam.io.files import in_reach, write_text
from dqslam.io.formats import Format, Look
from dqslam.io.trajectory.columns import WITH_ID, read_columns
from dqslam.io.trajectory.header import FIELDS, find_header, split_row

LONGEST = 2.0  #: of four numbers that may be a quaternion; width and height of boxes are longer


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
    if find_header(look.comments, look.first) is not None:
        return True
    cells = split_row(look.first)
    if len(cells) not in (len(FIELDS), WITH_ID):
        return False
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        # Its error names the cell. A camera of COLMAP has 8 fields, too, its model in the second.
        return "," not in look.first and len(cells) == len(FIELDS) and not cells[1][0].isupper()
    if "," in look.first and cells[0].isdigit():
        return False  # EuRoC's, with w first, or frames of MOT
    # Boxes of MOT have as many numbers, but the first two, frame and id, are whole ones. If the
    # numbers of a trajectory are no quaternion, its error says so.
    if len(cells) == len(FIELDS) and any(value % 1 for value in values[:2]):
        return True
    length = np.linalg.norm(in_reach(np.array(values[4:8])))
    may_turn = not np.isfinite(length) or length <= LONGEST
    return bool(may_turn) and (len(cells) == len(FIELDS) or cells[8].isdigit())


TUM = Format(
    "tum",
    "8 fields a line, t tx ty tz qx qy qz qw, or a header that names them",
    _looks,
    read_columns,
    write_tum,
    endings=(".txt", ".tum"),
)
