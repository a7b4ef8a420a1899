"""Cameras from files, a module for each format; all become OpenCV's pinhole with k1 k2 p1 p2 k3."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.io.camera.colmap import COLMAP
from dqslam.io.camera.kitti import KITTI_CALIB
from dqslam.io.camera.ros import ROS
from dqslam.io.camera.rosbag import CAMERA_INFO
from dqslam.io.camera.table import JSON, TOML
from dqslam.io.files import FileError
from dqslam.io.formats import choose_format, guarded
from dqslam.io.rosbag import check_topic

__all__ = ["CAMERA_FORMATS", "read_camera"]

CAMERA_FORMATS = (CAMERA_INFO, JSON, TOML, ROS, COLMAP, KITTI_CALIB)


def read_camera(
    path: str | Path,
    format: str | None = None,
    *,
    topic: str | None = None,
    image_size: tuple[int, int] | None = None,
) -> _core.Camera:
    """Read a pinhole camera with its lens distortion.

    ``format`` is one of CAMERA_FORMATS; by default it is recognized from the file. ``topic``
    selects one of several cameras in a bag. ``image_size`` is width and height in px, for a file
    that has none.

    Raises
    ------
    FileError
        If the file is missing, in no known format, or wrong, or if its images have another size.
    """
    chosen = choose_format(path, format, CAMERA_FORMATS, "camera")
    check_topic(chosen.name, topic)
    options: dict[str, Any] = {} if topic is None else {"topic": topic}
    if chosen is KITTI_CALIB:
        options["image_size"] = image_size
    camera: _core.Camera = guarded(path, chosen.name, chosen.read, path, **options)
    if image_size not in (None, (camera.width, camera.height)):
        own = f"{camera.width} x {camera.height}"
        raise FileError(
            path, "the camera's images have {} px, not {} x {}".format(own, *image_size)
        )
    return camera
