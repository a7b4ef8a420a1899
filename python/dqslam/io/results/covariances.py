"""Covariances of an estimate's poses as CSV, one row for each pose with a known covariance.

``timestamp``
    Seconds; it is the time of a pose in ``trajectory.txt``.
``c11 c12 .. c16 c22 .. c66``
    The upper triangle of the covariance of the camera's pose in the frame of the camera, for x y
    z of its position [m] and then of its rotation vector [rad]. The first pose is exact, and the
    covariances of the others are relative to it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.estimate import Estimate
from dqslam.io.csv_table import read_csv
from dqslam.io.files import write_text

_ROWS, _COLUMNS = np.triu_indices(6)
ENTRIES = tuple(f"c{row + 1}{column + 1}" for row, column in zip(_ROWS, _COLUMNS, strict=True))


def write_covariances(path: str | Path, estimate: Estimate, covariances: Floats) -> None:
    """Write the covariances of poses (n, k, k), NaN for none, converted from robot to camera.

    ``covariances`` is in the frames of the robot's poses, as in ``uncertainty.Marginals``.
    """
    size = 3 if estimate.pose_model == _core.PoseModel.SE2 else 6
    count = len(estimate.timestamps)
    if covariances.shape != (count, size, size):
        raise ValueError(
            f"marginals.poses: expected shape {(count, size, size)}, got {covariances.shape}"
        )
    camera_from_robot = motion_of_camera(estimate.pose_model, estimate.camera)
    moved = camera_from_robot @ covariances @ camera_from_robot.T
    known = np.isfinite(moved).all(axis=(1, 2))
    write_rows(path, estimate.timestamps[known], moved[known])


def write_rows(path: str | Path, timestamps: Floats, covariances: Floats) -> None:
    """Write covariances (n, 6, 6) unchanged, one row for each of the times (n,)."""
    lines = [",".join(("timestamp", *ENTRIES)) + "\n"]
    for time, covariance in zip(timestamps.tolist(), covariances, strict=True):
        entries = (f"{entry:.9g}" for entry in covariance[_ROWS, _COLUMNS])
        lines.append(",".join((repr(time), *entries)) + "\n")
    write_text(path, lines)


def read_covariances(path: str | Path, timestamps: Floats) -> Floats:
    """Read the covariances of poses at these times (n,), shape (n, 6, 6); NaN where missing."""
    table = read_csv(path, required=("timestamp", *ENTRIES), allow_empty=True)
    time = table.numbers("timestamp")
    pose = np.searchsorted(timestamps, time).clip(max=len(timestamps) - 1)
    table.reject(timestamps[pose] != time, "timestamp {} is of no pose", "timestamp")
    upper = np.zeros((len(table), 6, 6))
    upper[:, _ROWS, _COLUMNS] = np.column_stack([table.numbers(name) for name in ENTRIES])
    full = np.triu(upper) + np.triu(upper, 1).transpose(0, 2, 1)
    negative = np.any(np.diagonal(full, axis1=1, axis2=2) < 0.0, axis=1)
    table.reject(negative, "a variance is negative")
    covariances = np.full((len(timestamps), 6, 6), np.nan)
    covariances[pose] = full
    return covariances


def motion_of_camera(model: _core.PoseModel, camera: _core.Camera) -> Floats:
    """Return the adjoint that maps a small motion of the robot to that of its camera, (6, k)."""
    se3 = _core.PoseModel.SE3
    camera_from_robot = _core.inverse(se3, camera.robot_from_camera[None])
    (full,) = _core.adjoint(se3, camera_from_robot)
    return np.asarray(full[:, [0, 1, 5]] if model == _core.PoseModel.SE2 else full)
