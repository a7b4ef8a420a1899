"""Cameras from files, a module for each format; all become OpenCV's pinhole with k1 k2 p1 p2 k3."""

from __future__ import annotations

from pathlib import Path

from dqslam import _core
from dqslam.io.camera.colmap import COLMAP
from dqslam.io.camera.kitti import KITTI_CALIB
from dqslam.io.camera.ros import ROS
from dqslam.io.camera.rosbag import CAMERA_INFO
from dqslam.io.camera.table import JSON, TOML
from dqslam.io.formats import choose_format
from dqslam.io.rosbag import topic_option

__all__ = ["CAMERA_FORMATS", "read_camera"]

CAMERA_FORMATS = (CAMERA_INFO, JSON, TOML, ROS, COLMAP, KITTI_CALIB)


def read_camera(
    path: str | Path, format: str | None = None, *, topic: str | None = None
) -> _core.Camera:
    """Read a pinhole camera with its lens distortion.

    ``format`` is one of CAMERA_FORMATS; by default it is recognized from the file. ``topic``
    selects one of several cameras in a bag.
    """
    chosen = choose_format(path, format, CAMERA_FORMATS, "camera")
    return chosen.read(path, **topic_option(chosen.name, topic))
