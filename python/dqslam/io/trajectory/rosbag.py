"""Trajectories from ROS bags: nav_msgs/Odometry.

A message's pose is that of its child frame in its parent frame, and is used as world_from_camera.
Usually the child is the robot's base (x forward, z up), and ``body_from_camera`` must be given.
Times are those of the headers, to 0.24 microseconds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam.io.files import FileError
from dqslam.io.formats import Format, Progress, no_progress
from dqslam.io.frames import FrameTimes
from dqslam.io.rosbag import LOOKS, NAME, looks_like_bag, messages, stamp_seconds
from dqslam.io.trajectory.table import Trajectory, make_trajectory

KIND = "nav_msgs/msg/Odometry"


def read_odometry(
    path: str | Path,
    *,
    frames: FrameTimes | None = None,
    repeated_times: bool = False,
    topic: str | None = None,
    progress: Progress = no_progress,
) -> Trajectory:
    """Read the odometry of a bag; ``frames`` are not used, because it has times."""
    times, rows = [], []
    for where, message in messages(path, KIND, topic, progress):
        p, q = message.pose.pose.position, message.pose.pose.orientation
        row = [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
        if not np.isfinite(row).all():
            raise FileError(path, f"{where}: pose is not finite")
        rows.append(row)
        times.append(stamp_seconds(message))
    if not rows:
        raise FileError(path, f"holds no {KIND}")
    # The lines of a bag are its messages.
    return make_trajectory(
        path,
        np.array(times),
        np.array(rows, dtype=float),
        range(1, len(rows) + 1),
        repeated_times=repeated_times,
    )


ODOMETRY = Format(NAME, LOOKS, looks_like_bag, read_odometry, tells_share=True)
