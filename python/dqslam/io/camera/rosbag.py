"""Cameras from ROS bags: the first sensor_msgs/CameraInfo, with the conventions of `ros`."""

from __future__ import annotations

from pathlib import Path

from dqslam import _core
from dqslam.io.camera.ros import camera_of_info
from dqslam.io.files import FileError
from dqslam.io.formats import Format
from dqslam.io.rosbag import LOOKS, NAME, looks_like_bag, messages

KIND = "sensor_msgs/msg/CameraInfo"
FIELDS = ("width", "height", "distortion_model")


def read_camera_info(path: str | Path, *, topic: str | None = None) -> _core.Camera:
    """Read the camera of a bag."""
    for _, message in messages(path, KIND, topic):
        table = {name: getattr(message, name) for name in FIELDS}
        for name in ("k", "d"):
            values = getattr(message, name, None)
            table[name] = (
                values if values is not None else getattr(message, name.upper())
            ).tolist()
        return camera_of_info(path, table)
    raise FileError(path, f"holds no {KIND}")


CAMERA_INFO = Format(NAME, LOOKS, looks_like_bag, read_camera_info)
