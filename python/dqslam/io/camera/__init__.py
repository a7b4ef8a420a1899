"""Cameras from files, a module for each format; all become a pinhole behind a lens model."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

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
from dqslam.io.files import FileError
from dqslam.io.formats import choose_format, guarded
from dqslam.io.rosbag import check_topic

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
    image_size: tuple[int, int] | None = None,
) -> _core.Camera:
    """Read a pinhole camera with its lens.

    ``format`` is one of CAMERA_FORMATS; by default it is recognized from the file. ``topic``
    selects one of several cameras in a bag, and ``camera_id`` one of several in a file.
    ``image_size`` is width and height in px, for a file that has none.

    Raises
    ------
    FileError
        If the file is missing, in no known format, or wrong, if it holds several cameras and none
        is chosen, if it says something about its lens or its image that is not known, or if its
        images have another size.
    """
    chosen = choose_format(path, format, CAMERA_FORMATS, "camera")
    check_topic(chosen.name, topic)
    options: dict[str, Any] = {} if topic is None else {"topic": topic}
    known = inspect.signature(chosen.read).parameters
    if camera_id is not None:
        if "camera_id" not in known:
            raise ValueError(f"camera {camera_id}: a file of format {chosen.name} has one camera")
        options["camera_id"] = camera_id
    if "image_size" in known:
        options["image_size"] = image_size
    camera: _core.Camera = guarded(path, chosen.name, chosen.read, path, **options)
    if image_size not in (None, (camera.width, camera.height)):
        own = f"{camera.width} x {camera.height}"
        raise FileError(
            path, "the camera's images have {} px, not {} x {}".format(own, *image_size)
        )
    return camera
