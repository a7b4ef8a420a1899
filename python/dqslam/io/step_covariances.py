"""The covariance of each step of odometry, which no format of trajectories has.

It is CSV with the columns of ``covariance.csv`` in results. ``timestamp`` is that of the pose at
which the step ends, and ``c11 c12 .. c66`` are the upper triangle of the covariance of the motion
[m, rad] in the frame of the camera there.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.io.files import FileError
from dqslam.io.results.covariances import motion_of_camera, read_covariances, write_rows
from dqslam.recording import Recording

# Sigma of height and tilt for odometry on the plane, m and rad per step. Such odometry has no noise
# in these, but a covariance in space must not be singular.
OUT_OF_PLANE_SIGMA = 1e-3


def read_step_covariances(path: str | Path, timestamps: Floats) -> Floats:
    """Read the covariances of the steps between poses at these times (n,), shape (n - 1, 6, 6)."""
    covariance = read_covariances(path, timestamps)[1:]
    for time, one in zip(timestamps[1:], covariance, strict=True):
        if not np.isfinite(one).all():
            raise FileError(path, f"no covariance of the step that ends at {time:.6f} s")
        if np.linalg.eigvalsh(one)[0] <= 0.0:
            raise FileError(path, f"the covariance at {time:.6f} s is not positive definite")
    return covariance


def write_step_covariances(path: str | Path, recording: Recording) -> None:
    """Write the covariances of a recording's steps, converted to those of its camera."""
    model, covariance = recording.odometry.pose_model, recording.odometry.covariance
    camera_from_robot = motion_of_camera(model, recording.camera)
    moved = camera_from_robot @ covariance @ camera_from_robot.T
    if model == _core.PoseModel.SE2:
        in_space = motion_of_camera(_core.PoseModel.SE3, recording.camera)[:, 2:5]
        moved = moved + OUT_OF_PLANE_SIGMA**2 * in_space @ in_space.T
    write_rows(path, recording.timestamps[1:], moved)
