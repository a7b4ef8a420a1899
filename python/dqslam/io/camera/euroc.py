"""Cameras from the ``sensor.yaml`` of EuRoC's data sets.

``intrinsics`` are fu fv cu cv, ``resolution`` is width, height, and ``distortion_coefficients`` are
k1 k2 p1 p2 of the model radial-tangential, or k1 k2 k3 k4 of equidistant. Integer pixel coordinates
are pixel centers. The mount T_BS is read by ``read_mount``.
"""

from __future__ import annotations

import re
from pathlib import Path

from dqslam import _core
from dqslam.io.camera.look import is_yaml
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import read_yaml_table
from dqslam.io.formats import Format

_LOOKS = re.compile(r"^sensor_type\s*:\s*['\"]?camera", re.MULTILINE)


def read_euroc_sensor(path: str | Path) -> _core.Camera:
    """Read the camera of a sensor.yaml."""
    return camera_of_names(read_yaml_table(path))


EUROC_SENSOR = Format(
    "euroc-sensor",
    "a .yaml with sensor_type: camera",
    lambda look: is_yaml(look) and bool(_LOOKS.search(look.head)),
    read_euroc_sensor,
)
