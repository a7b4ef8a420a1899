"""Cameras from files, a module for each format; all become a pinhole behind a lens model."""

from __future__ import annotations

import inspect
from pathlib import Path

from dqslam import _core
from dqslam.io.camera.colmap import COLMAP
from dqslam.io.camera.euroc import EUROC_SENSOR
from dqslam.io.camera.kalibr import KALIBR
from dqslam.io.camera.kitti import KITTI_CALIB
from dqslam.io.camera.nerf import NERF
from dqslam.io.camera.open3d import OPEN3D
from dqslam.io.camera.opencv import OPENCV
from dqslam.io.camera.orbslam import ORBSLAM
from dqslam.io.camera.realsense import REALSENSE
from dqslam.io.camera.ros import ROS
from dqslam.io.camera.rosbag import CAMERA_INFO
from dqslam.io.camera.table import JSON, TOML
from dqslam.io.formats import choose_format
from dqslam.io.rosbag import topic_option

__all__ = ["CAMERA_FORMATS", "read_camera"]

# In the order in which they are tried: of one ending, the general one comes last.
CAMERA_FORMATS = (
    *(CAMERA_INFO, REALSENSE, OPEN3D, NERF, JSON, TOML),
    *(ORBSLAM, OPENCV, KALIBR, EUROC_SENSOR, ROS, COLMAP, KITTI_CALIB),
)


def read_camera(
    path: str | Path,
    format: str | None = None,
    *,
    topic: str | None = None,
    camera_id: str | None = None,
) -> _core.Camera:
    """Read a pinhole camera with its lens.

    ``format`` is one of CAMERA_FORMATS; by default it is recognized from the file. ``topic``
    selects one of several cameras in a bag, and ``camera_id`` one of several in a file.

    Raises
    ------
    FileError
        If the file is wrong, holds several cameras and none is chosen, or says something about its
        lens or its image that is not known.
    """
    chosen = choose_format(path, format, CAMERA_FORMATS, "camera")
    options = topic_option(chosen.name, topic)
    if camera_id is not None:
        if "camera_id" not in inspect.signature(chosen.read).parameters:
            raise ValueError(f"camera {camera_id}: a file of format {chosen.name} has one camera")
        options["camera_id"] = camera_id
    return chosen.read(path, **options)
