"""Cameras from ROS bags: the first sensor_msgs/CameraInfo, with the conventions of `ros`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.io.camera.ros import camera_of_info
from dqslam.io.camera.tables import Table
from dqslam.io.files import FileError
from dqslam.io.formats import Format
from dqslam.io.rosbag import LOOKS, NAME, looks_like_bag, messages

KIND = "sensor_msgs/msg/CameraInfo"
FIELDS = ("width", "height", "distortion_model", "binning_x", "binning_y")
REGION = ("x_offset", "y_offset", "width", "height")


def read_camera_info(path: str | Path, *, topic: str | None = None) -> _core.Camera:
    """Read the camera of a bag."""
    for _, message in messages(path, KIND, topic):
        return camera_of_message(message, path)
    raise FileError(path, f"holds no {KIND}")


def camera_of_message(message: Any, source: str | Path = "camera_info") -> _core.Camera:
    """Return the camera of the raw image, of a sensor_msgs/CameraInfo of ROS 1 or 2.

    Raises
    ------
    FileError
        If it is not calibrated or its lens model is not known; ``source`` is named in the message.
    """
    values: dict[str, Any] = {name: getattr(message, name) for name in FIELDS}
    values["roi"] = {name: getattr(message.roi, name) for name in REGION}
    for name in ("k", "d"):
        numbers = getattr(message, name, None)
        if numbers is None:
            numbers = getattr(message, name.upper())
        values[name] = [float(number) for number in numbers]
    return camera_of_info(Table(source, "", values))


CAMERA_INFO = Format(NAME, LOOKS, looks_like_bag, read_camera_info)
