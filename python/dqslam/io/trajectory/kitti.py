"""KITTI trajectories: 12 numbers a line, the rows of the 3 x 4 matrix [R t] world_from_camera.

Lengths are in meters; the camera's x points right, y down, z forward. Line i, from 0, is frame i.
There are no times, see `dqslam.io.frames`. In KITTI's odometry benchmark the camera is number 0,
the left gray one; camera 2 is 6 cm beside it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam.io.files import FileError, read_rows, write_text
from dqslam.io.formats import Format, Look
from dqslam.io.frames import FrameTimes
from dqslam.io.trajectory.table import Trajectory, make_trajectory, parse_columns

FIELDS = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3, 4))
# KITTI's own files are rounded to 7 digits; a larger error means that it is not a rotation.
ROTATION_TOLERANCE = 1e-3


def read_kitti(
    path: str | Path, *, frames: FrameTimes | None = None, repeated_times: bool = False
) -> Trajectory:
    """Read a KITTI trajectory whose times are those of its ``frames``."""
    from scipy.spatial.transform import Rotation

    rows, lines = read_rows(path)
    if frames is None:
        raise FileError(
            path, "kitti has no times: give them with --frame-times FILE or --frame-rate HZ"
        )
    fields = [row.split() for row in rows]
    for row, line in zip(fields, lines, strict=True):
        if len(row) != len(FIELDS):
            raise FileError(path, f"{len(row)} fields, not the 12 of a 3 x 4 matrix", line)
    matrices = parse_columns(path, FIELDS, fields, lines).reshape(-1, 3, 4)
    rotations = matrices[:, :, :3]
    skew = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((skew > ROTATION_TOLERANCE) | (np.linalg.det(rotations) < 0))
    if bad.size:
        i = bad[0]
        message = (
            f"the 3 x 3 part is no rotation (R R' differs from 1 by {skew[i]:.2g}, "
            f"determinant {np.linalg.det(rotations[i]):.3g})"
        )
        raise FileError(path, message, lines[i])
    quaternions = Rotation.from_matrix(rotations).as_quat(canonical=True)
    times = frames.at(path, np.arange(len(rows)), lines)
    poses = np.hstack([matrices[:, :, 3], quaternions])
    return make_trajectory(path, times, poses, lines, repeated_times=repeated_times)


def write_kitti(path: str | Path, timestamps: ArrayLike, world_from_camera: ArrayLike) -> None:
    """Write poses (n, 7) as KITTI matrices, which have no times."""
    from scipy.spatial.transform import Rotation

    poses = np.asarray(world_from_camera, dtype=float)
    matrices = np.empty((len(poses), 3, 4))
    matrices[:, :, :3] = Rotation.from_quat(poses[:, 3:]).as_matrix()
    matrices[:, :, 3] = poses[:, :3]
    rows = matrices.reshape(-1, 12).tolist()
    write_text(path, (" ".join(f"{value:.12f}" for value in row) + "\n" for row in rows))


def _looks(look: Look) -> bool:
    return "," not in look.first and len(look.first.split()) == len(FIELDS)


KITTI = Format(
    "kitti",
    "12 fields a line, a 3 x 4 matrix",
    _looks,
    read_kitti,
    write_kitti,
    needs_times=False,
    has_times=lambda _: False,
    loses=("times",),
)
