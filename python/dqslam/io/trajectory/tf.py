"""The tree of frames of a ROS bag: the pose of the camera in the world, from /tf and /tf_static.

A transform is the pose of its child frame in its parent frame. The camera is the frame of the bag's
CameraInfo; the world is the root above it. Poses have the times of the moving transform that is
nearest to the camera; others are interpolated to them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.io.files import FileError
from dqslam.io.formats import ReadContext
from dqslam.io.notes import Notes
from dqslam.io.rosbag import bag_topics, messages, seconds_of

TF = "tf2_msgs/msg/TFMessage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
STATIC = "tf_static"  #: how topics of transforms that do not move end
SE3 = _core.PoseModel.SE3


@dataclass
class Transforms:
    """The transforms of one frame in its parent frame."""

    parent: str
    static: bool
    times: list[float] = field(default_factory=list)
    poses: list[list[float]] = field(default_factory=list)

    def at(self, times: Floats) -> Floats:
        """Return the poses (n, 7) at times (n,), interpolated."""
        from scipy.spatial.transform import Rotation, Slerp

        own, first = np.unique(self.times, return_index=True)
        poses = np.array(self.poses)[first]
        if self.static or len(own) == 1:
            return np.tile(poses[-1], (len(times), 1))
        within = np.clip(times, own[0], own[-1])
        places = [np.interp(within, own, poses[:, axis]) for axis in range(3)]
        turns = Slerp(own, Rotation.from_quat(poses[:, 3:]))(within).as_quat()
        return np.column_stack([*places, turns])


def plain_frame(name: str) -> str:
    """Return the name of a frame without the slash of ROS 1."""
    return name.strip().lstrip("/")


def pose_row(pose: Any) -> list[float]:
    """Return the seven numbers of a Pose: m and x y z w."""
    p, q = pose.position, pose.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


def camera_frame(path: str | Path, notes: Notes) -> str:
    """Return the frame of the camera of a bag, "" if there is none or there are several."""
    topics = [topic for topic, kind in bag_topics(path).items() if kind == CAMERA_INFO]
    frames = set()
    for topic in topics:
        _, message = next(messages(path, CAMERA_INFO, topic))
        frames.add(plain_frame(message.header.frame_id))
    if len(frames) > 1:
        notes.doubt(path, f"which is the camera: {', '.join(sorted(frames))}?")
    return frames.pop() if len(frames) == 1 else ""


def static_mount(path: str | Path, body: str, camera: str) -> Floats | None:
    """Return the pose (7,) of the camera in a body from transforms that do not move, or None."""
    tree = _read_tree(path, only_static=True)
    ups = [_up(tree, frame) for frame in (body, camera)]
    common = next((frame for frame in ups[1] if frame in ups[0]), None)
    if common is None:
        return None
    at = np.zeros(1)
    in_common = [_chain(tree, up[: up.index(common)], at) for up in ups]
    mount: Floats = _core.compose(SE3, _core.inverse(SE3, in_common[0]), in_common[1])[0]
    return mount


def tf_path(path: str | Path, context: ReadContext) -> tuple[Floats, Floats]:
    """Return times (n,) and world_from_camera (n, 7) from the transforms of a bag."""
    tree = _read_tree(path, only_static=False)
    moving = {frame: one for frame, one in tree.items() if not one.static}
    if not moving:
        raise FileError(path, "no transform of it moves")
    leaf = camera_frame(path, context.notes)
    if leaf not in tree:
        if len(moving) > 1:
            listed = ", ".join(f"{one.parent} > {frame}" for frame, one in sorted(moving.items()))
            raise FileError(path, f"which transform is the camera's? it has {listed}")
        (leaf,) = moving
        context.notes.doubt(path, f"the poses are those of {leaf}: is it the camera?")
    up = _up(tree, leaf)[:-1]
    nearest = next((frame for frame in up if frame in moving), None)
    if nearest is None:
        raise FileError(path, f"no transform above the camera, {leaf}, moves")
    times = np.unique(tree[nearest].times)
    for frame in up:
        if frame in moving:  # poses are known while all of them are
            own = tree[frame].times
            times = times[(times >= min(own)) & (times <= max(own))]
    if not len(times):
        raise FileError(path, "its transforms have no time in common")
    return times, _chain(tree, up, times)


def _read_tree(path: str | Path, *, only_static: bool) -> dict[str, Transforms]:
    tree: dict[str, Transforms] = {}
    topics = [topic for topic, kind in bag_topics(path).items() if kind == TF]
    for topic in topics:
        static = topic.endswith(STATIC)
        if only_static and not static:
            continue
        for where, message in messages(path, TF, topic):
            for transform in message.transforms:
                child = plain_frame(transform.child_frame_id)
                parent = plain_frame(transform.header.frame_id)
                one = tree.setdefault(child, Transforms(parent, static))
                if one.parent != parent:
                    text = f"{where}: {child} has two parents, {one.parent} and {parent}"
                    raise FileError(path, text)
                t, q = transform.transform.translation, transform.transform.rotation
                row = [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
                if not np.isfinite(row).all() or abs(np.linalg.norm(row[3:]) - 1) > 1e-3:
                    raise FileError(path, f"{where}: the transform of {child} is no pose")
                one.times.append(seconds_of(transform.header))
                one.poses.append(row)
    return tree


def _up(tree: dict[str, Transforms], frame: str) -> list[str]:
    """Return a frame and all frames above it, up to the root."""
    up = [frame]
    while up[-1] in tree and tree[up[-1]].parent not in up:
        up.append(tree[up[-1]].parent)
    return up


def _chain(tree: dict[str, Transforms], frames: list[str], times: Floats) -> Floats:
    """Return the poses (n, 7) of the first frame in the parent of the last one, at times (n,)."""
    poses = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(times), 1))
    for frame in frames:
        poses = _core.compose(SE3, tree[frame].at(times), poses)
    return poses
