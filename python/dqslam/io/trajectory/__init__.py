"""Trajectories from files, a module for each format; all become world_from_camera at times in s."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from dqslam import _core
from dqslam.io.formats import Progress, ReadContext, choose_format, guarded, no_progress
from dqslam.io.frames import FrameTimes
from dqslam.io.notes import Notes
from dqslam.io.rosbag import check_topic
from dqslam.io.trajectory.colmap import COLMAP_IMAGES
from dqslam.io.trajectory.euroc import EUROC
from dqslam.io.trajectory.kitti import KITTI, KITTI_360
from dqslam.io.trajectory.rosbag import BAG_TRAJECTORY
from dqslam.io.trajectory.table import Trajectory as Trajectory
from dqslam.io.trajectory.tum import TUM
from dqslam.io.trajectory.tum import write_tum as write_trajectory

__all__ = ["TRAJECTORY_FORMATS", "Trajectory", "read_trajectory", "write_trajectory"]

# A file is of the first of these that it looks like.
TRAJECTORY_FORMATS = (BAG_TRAJECTORY, COLMAP_IMAGES, EUROC, TUM, KITTI, KITTI_360)


def read_trajectory(
    path: str | Path,
    format: str | None = None,
    *,
    frames: FrameTimes | None = None,
    body_from_camera: ArrayLike | None = None,
    has_mount: bool = False,
    repeated_times: bool = False,
    topic: str | None = None,
    progress: Progress = no_progress,
    notes: Notes | None = None,
) -> Trajectory:
    """Read a trajectory.

    Parameters
    ----------
    path
        A file, the folder of a bag, or - for standard input.
    format
        One of TRAJECTORY_FORMATS; by default it is recognized from the file.
    frames
        Times of the frames, for a format that has none.
    body_from_camera
        Pose (7,) of the camera in the body, m and x y z w, for the trajectory of a body.
    has_mount
        Whether the caller knows that pose instead, and applies it.
    repeated_times
        Whether to leave out any repeated time instead of refusing it. Motion capture at a high rate
        has a few, because times are rounded.
    topic
        Topic of a bag that has several.
    progress
        Called with the share of a bag or a folder that has been read.
    notes
        Collects what is left out and what is doubtful, and says how many bad poses may be left out;
        by default these are warnings of Python, of the category ``InputWarning``.

    Raises
    ------
    FileError
        If the file is missing, in no known format, or wrong.
    """
    chosen = choose_format(path, format, TRAJECTORY_FORMATS, "trajectory")
    check_topic(chosen.name, topic)
    own = Notes() if notes is None else notes
    context = ReadContext(
        frames=frames,
        repeated_times=repeated_times,
        topic=topic,
        progress=progress,
        notes=own,
        has_mount=has_mount or body_from_camera is not None,
    )
    trajectory: Trajectory = guarded(path, chosen.name, chosen.read, path, context)
    if notes is None:
        own.warn()
    if body_from_camera is None:
        return trajectory
    mount = np.tile(np.asarray(body_from_camera, dtype=float), (len(trajectory.timestamps), 1))
    cameras = _core.compose(_core.PoseModel.SE3, trajectory.world_from_camera, mount)
    return Trajectory(trajectory.timestamps, cameras)
