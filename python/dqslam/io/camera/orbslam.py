"""Cameras from the settings of ORB-SLAM2 and ORB-SLAM3.

``Camera.fx`` or, in newer files, ``Camera1.fx`` and ``Camera2.fx``. ``Camera.type`` is PinHole,
with k1 k2 p1 p2 k3, KannalaBrandt8, with k1 k2 k3 k4, or Rectified. Integer pixel coordinates
are centers of pixels. Files for stereo pairs also have ``LEFT.K`` and ``LEFT.D`` of the images as
recorded, beside the ``Camera`` of the rectified ones. The names before the point are the ids. Sizes
to which the program reduces its images, ``Camera.newWidth``, are not those of the recorded ones.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.io.camera.build import choose_camera
from dqslam.io.camera.look import is_yaml
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import read_yaml_table
from dqslam.io.files import FileError
from dqslam.io.formats import Format

_KEY = re.compile(r"(Camera\d*|LEFT|RIGHT)\.(\w+)")
_LOOKS = re.compile(r"^\s*Camera\d*\.fx\s*:", re.MULTILINE)
_OF_ALL = ("width", "height", "type")


def read_orbslam(path: str | Path, *, camera_id: str | None = None) -> _core.Camera:
    """Read a camera of settings."""
    table = read_yaml_table(path)
    cameras: dict[str, dict[str, Any]] = {}
    for key, value in table.values.items():
        if match := _KEY.fullmatch(str(key)):
            cameras.setdefault(match[1], {})[match[2]] = value
    # In newer files the size and the type are shared by Camera1 and Camera2.
    shared = {key: cameras["Camera"][key] for key in _OF_ALL if key in cameras.get("Camera", {})}
    whole = {
        name: table.part(shared | values if name.startswith("Camera") else values)
        for name, values in cameras.items()
        if {"fx", "K"} & set(values)
    }
    if not whole:
        raise FileError(path, "has no Camera.fx or Camera1.fx")
    chosen = choose_camera(path, whole, camera_id)
    if not {"width", "height"} <= set(chosen.values):
        message = "no image size: add lines like Camera.width: 640 and Camera.height: 480"
        raise FileError(path, message)
    return camera_of_names(chosen)


ORBSLAM = Format(
    "orbslam",
    "a .yaml with Camera.fx: or Camera1.fx:",
    lambda look: is_yaml(look) and bool(_LOOKS.search(look.head)),
    read_orbslam,
)
