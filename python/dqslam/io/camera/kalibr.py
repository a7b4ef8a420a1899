"""Cameras from Kalibr's camchain: ``cam0``, ``cam1``, ..., which are the ids.

``intrinsics`` are fu fv pu pv, ``distortion_model`` is radtan, equidistant, fov or none, and
``resolution`` is width, height. Integer pixel coordinates are pixel centers. Only the projection
``pinhole`` is read: omni, double sphere and eucm have none that is a pinhole behind a lens.
"""

from __future__ import annotations

import re
from pathlib import Path

from dqslam import _core
from dqslam.io.camera.build import choose_camera
from dqslam.io.camera.look import is_yaml
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import Table, read_yaml_table
from dqslam.io.files import FileError
from dqslam.io.formats import Format

CAMERA = re.compile(r"cam\d+")
_LOOKS = re.compile(r"^cam\d+\s*:", re.MULTILINE)


def read_kalibr(path: str | Path, *, camera_id: str | None = None) -> _core.Camera:
    """Read a camera of a camchain."""
    table = read_yaml_table(path)
    cameras = {
        key: table.part(value)
        for key, value in table.values.items()
        if isinstance(key, str) and CAMERA.fullmatch(key) and isinstance(value, dict)
    }
    if not cameras:
        raise FileError(path, "has no table cam0")
    return _camera(choose_camera(path, cameras, camera_id))


def _camera(table: Table) -> _core.Camera:
    model = table.values.get("camera_model")
    if model != "pinhole":
        raise table.error(f"camera_model is {model}; only pinhole is known", "camera_model")
    return camera_of_names(table)


KALIBR = Format(
    "kalibr",
    "a .yaml with cam0:",
    lambda look: is_yaml(look) and bool(_LOOKS.search(look.head)),
    read_kalibr,
)
