"""Trajectories from files, a module for each format; all become world_from_camera at times in s."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam.io.formats import Progress, choose_format, no_progress
from dqslam.io.frames import FrameTimes
from dqslam.io.rosbag import topic_option
from dqslam.io.trajectory.euroc import EUROC
from dqslam.io.trajectory.kitti import KITTI
from dqslam.io.trajectory.rosbag import ODOMETRY
from dqslam.io.trajectory.table import Trajectory as Trajectory
from dqslam.io.trajectory.tum import TUM
from dqslam.io.trajectory.tum import write_tum as write_trajectory

__all__ = ["TRAJECTORY_FORMATS", "Trajectory", "read_trajectory", "write_trajectory"]

TRAJECTORY_FORMATS = (ODOMETRY, TUM, KITTI, EUROC)


def read_trajectory(
    path: str | Path,
    format: str | None = None,
    *,
    frames: FrameTimes | None = None,
    body_from_camera: ArrayLike | None = None,
    repeated_times: bool = False,
    topic: str | None = None,
    progress: Progress = no_progress,
) -> Trajectory:
    """Read a trajectory.

    Parameters
    ----------
    path
        A file, or the folder of a bag.
    format
        One of TRAJECTORY_FORMATS; by default it is recognized from the file.
    frames
        Times of the frames, for a format that has none.
    body_from_camera
        Pose (7,) of the camera in the body, m and x y z w, for the trajectory of a body.
    repeated_times
        Whether to leave out a repeated time instead of refusing it. Motion capture at a high rate
        has a few, because times are rounded.
    topic
        Topic of a bag that has several.
    progress
        Called with the share of a bag or a folder that has been read.
    """
    chosen = choose_format(path, format, TRAJECTORY_FORMATS, "trajectory")
    options: dict[str, Any] = dict(topic_option(chosen.name, topic))
    if chosen.tells_share:
        options["progress"] = progress
    trajectory = chosen.read(path, frames=frames, repeated_times=repeated_times, **options)
    if body_from_camera is None:
        return trajectory
    mount = np.tile(np.asarray(body_from_camera, dtype=float), (len(trajectory.timestamps), 1))
    cameras = _core.compose(_core.PoseModel.SE3, trajectory.world_from_camera, mount)
    return Trajectory(trajectory.timestamps, cameras)
