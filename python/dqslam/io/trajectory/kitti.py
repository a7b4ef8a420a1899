"""KITTI trajectories: 12 numbers a line, the rows of the 3 x 4 matrix [R t] world_from_camera.

With 16 numbers they are those of the 4 x 4 matrix. KITTI-360's lines begin with the number of the
frame, from 0, before the 12 (``poses.txt``, of the IMU) or 16 (``cam0_to_world.txt``) numbers.

Lengths are in meters; the camera's x points right, y down, z forward. Line i, from 0, is frame i.
There are no times, see `dqslam.io.frames`. In KITTI's odometry benchmark the camera is number 0,
the left gray one; camera 2 is 6 cm beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam._checks import Ints
from dqslam.io.files import FileError, parse_integers, read_rows, write_text
from dqslam.io.formats import Format, Look, ReadContext
from dqslam.io.trajectory.table import Trajectory, make_trajectory, parse_columns

FIELDS = tuple(f"r{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3, 4))
FULL = (*FIELDS, "r41", "r42", "r43", "r44")
# KITTI's own files are rounded to 7 digits; a larger error means that it is not a rotation.
ROTATION_TOLERANCE = 1e-3


def read_kitti(path: str | Path, context: ReadContext) -> Trajectory:
    """Read a KITTI trajectory whose times are those of its frames."""
    rows, lines = read_rows(path)
    fields = [row.split() for row in rows]
    return matrix_trajectory(path, "kitti", np.arange(len(rows)), fields, lines, context)


def read_kitti360(path: str | Path, context: ReadContext) -> Trajectory:
    """Read a KITTI-360 trajectory, whose lines begin with the number of the frame."""
    rows, lines = read_rows(path)
    fields = [row.split() for row in rows]
    frames = parse_integers(path, "frame", [row[0] for row in fields], lines)
    return matrix_trajectory(path, "kitti360", frames, [row[1:] for row in fields], lines, context)


def matrix_trajectory(
    path: str | Path,
    name: str,
    frames: Ints,
    fields: Sequence[Sequence[str]],
    lines: Sequence[int],
    context: ReadContext,
) -> Trajectory:
    """Make a trajectory of matrices, 12 or 16 fields each, at the times of ``frames`` (n,)."""
    from scipy.spatial.transform import Rotation

    if context.frames is None:
        raise FileError(
            path, f"{name} has no times: give them with --frame-times FILE or --frame-rate HZ"
        )
    for row, line in zip(fields, lines, strict=True):
        if len(row) not in (len(FIELDS), len(FULL)) or len(row) != len(fields[0]):
            message = f"{len(row)} fields, not the 12 of a 3 x 4 matrix or the 16 of a 4 x 4 one"
            raise FileError(path, message, line)
    values = parse_columns(path, FULL[: len(fields[0])], fields, lines).reshape(len(lines), -1, 4)
    matrices = values[:, :3]
    finite = np.asarray(np.isfinite(values).all(axis=(1, 2)))
    rotations = np.where(finite[:, None, None], matrices[:, :, :3], np.eye(3))
    skew = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    wrong = (skew > ROTATION_TOLERANCE) | (np.linalg.det(rotations) < 0)
    wrong |= finite & (values[:, 3:] != [[0, 0, 0, 1]]).any(axis=(1, 2))
    bad = np.flatnonzero(wrong)
    if bad.size:
        i = bad[0]
        message = (
            f"the 3 x 3 part is no rotation (R R' differs from 1 by {skew[i]:.2g}, "
            f"determinant {np.linalg.det(rotations[i]):.3g})"
            if skew[i] > ROTATION_TOLERANCE or np.linalg.det(rotations[i]) < 0
            else "the last row of the matrix is not 0 0 0 1"
        )
        raise FileError(path, message, lines[i])
    quaternions = Rotation.from_matrix(rotations).as_quat(canonical=True)
    times = context.frames.at(path, frames, lines)
    poses = np.hstack([matrices[:, :, 3], quaternions])
    poses[~finite] = np.nan
    return make_trajectory(path, times, poses, lines, context)


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
    return "," not in look.first and len(look.first.split()) in (len(FIELDS), len(FULL))


def _looks_360(look: Look) -> bool:
    fields = look.first.split()
    return (
        len(fields) in (1 + len(FIELDS), 1 + len(FULL))
        and fields[0].isdigit()
        and (all(_is_number(field) for field in fields))
    )


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


KITTI = Format(
    "kitti",
    "12 or 16 fields a line, a 3 x 4 or 4 x 4 matrix",
    _looks,
    read_kitti,
    write_kitti,
    needs_times=False,
    has_times=lambda _: False,
    loses=("times",),
)
KITTI_360 = Format(
    "kitti360",
    "13 or 17 fields a line, the number of the frame and a matrix",
    _looks_360,
    read_kitti360,
    needs_times=False,
    has_times=lambda _: False,
)
