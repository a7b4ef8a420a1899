"""Trajectories from ROS bags: the first of these kinds of messages that a bag has.

====================================  ========================================================
nav_msgs/Odometry                     the pose of the child frame in its parent frame
geometry_msgs/PoseWithCovarianceStamped, PoseStamped   the pose, of whatever it is
nav_msgs/Path                         the poses of the last message
tf2_msgs/TFMessage                    the pose of the camera, see `tf`
====================================  ========================================================

A pose is used as world_from_camera. Usually it is that of the robot's base (x forward, z up): if
the child frame of an Odometry is not the frame of the bag's camera (CameraInfo), /tf_static carries
the poses to the camera, or, without it, the difference is noted and ``body_from_camera`` must be
given. Times are those of the headers, to 0.24 microseconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dqslam import _core
from dqslam.io.files import FileError
from dqslam.io.formats import Format, ReadContext
from dqslam.io.rosbag import (
    LOOKS,
    NAME,
    bag_topics,
    kind_of_topic,
    looks_like_bag,
    messages,
    seconds_of,
)
from dqslam.io.trajectory.table import Trajectory, make_trajectory
from dqslam.io.trajectory.tf import TF, camera_frame, plain_frame, pose_row, static_mount, tf_path

ODOMETRY = "nav_msgs/msg/Odometry"
WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
POSE = "geometry_msgs/msg/PoseStamped"
PATH = "nav_msgs/msg/Path"
KINDS = (ODOMETRY, WITH_COVARIANCE, POSE, PATH, TF)

Row = tuple[float, list[float], str]
"""Time [s], pose [m and x y z w], and the frame whose pose it is, "" if not known."""


def read_bag_trajectory(path: str | Path, context: ReadContext) -> Trajectory:
    """Read the trajectory of a bag; it has times, so those of frames are not used."""
    kind = kind_of_topic(path, KINDS, context.topic)
    if kind is None or kind not in KINDS:
        has = ", ".join(f"{topic} ({kind})" for topic, kind in sorted(bag_topics(path).items()))
        asked = "" if context.topic is None else f" {context.topic}"
        raise FileError(path, f"no topic{asked} of {', '.join(KINDS)} (it has: {has or 'nothing'})")
    if kind == TF:
        times, poses = tf_path(path, context)
        return make_trajectory(path, times, poses, range(1, len(times) + 1), context)
    rows = list(_rows(path, kind, context))
    if not rows:
        raise FileError(path, f"holds no {kind}")
    children = sorted({child for _, _, child in rows})
    if len(children) > 1:
        raise FileError(path, f"its poses are of several frames: {', '.join(children)}")
    # The lines of a bag are its messages.
    trajectory = make_trajectory(
        path,
        np.array([time for time, _, _ in rows]),
        np.array([pose for _, pose, _ in rows], dtype=float),
        range(1, len(rows) + 1),
        context,
    )
    return trajectory if context.has_mount else _to_camera(path, trajectory, children[0], context)


def _rows(path: str | Path, kind: str, context: ReadContext) -> Iterator[Row]:
    last: Any = None
    for _, message in messages(path, kind, context.topic, context.progress):
        if kind == PATH:
            last = message
        elif kind == POSE:
            yield seconds_of(message.header), pose_row(message.pose), ""
        else:
            child = plain_frame(getattr(message, "child_frame_id", ""))
            yield seconds_of(message.header), pose_row(message.pose.pose), child
    if last is not None:
        for stamped in last.poses:
            yield seconds_of(stamped.header), pose_row(stamped.pose), ""


def _to_camera(
    path: str | Path, trajectory: Trajectory, child: str, context: ReadContext
) -> Trajectory:
    """Carry poses of a child frame to the camera of the bag, if they are not of the camera."""
    camera = camera_frame(path, context.notes)
    if not child or not camera or camera == child:
        return trajectory
    mount = static_mount(path, child, camera)
    if mount is None:
        context.notes.doubt(
            path,
            f"the poses are those of {child}, the camera is {camera}, and no /tf_static leads from "
            "one to the other: --camera-in-body FILE tells how",
        )
        return trajectory
    context.notes.doubt(
        path, f"the poses are those of {child}; /tf_static carries them to the camera, {camera}"
    )
    mounts = np.tile(mount, (len(trajectory.timestamps), 1))
    poses = _core.compose(_core.PoseModel.SE3, trajectory.world_from_camera, mounts)
    return Trajectory(trajectory.timestamps, poses)


BAG_TRAJECTORY = Format(NAME, LOOKS, looks_like_bag, read_bag_trajectory)
