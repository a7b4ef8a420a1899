"""Cameras from Open3D's JSON: a PinholeCameraIntrinsic, alone or in a trajectory of cameras.

``intrinsic_matrix`` has its 9 numbers column by column, and integer pixel coordinates are pixel
centers. A trajectory has the same intrinsics for each of its views, or its views are cameras with
the ids 0, 1, ...
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.io.camera.build import choose_camera
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import read_json_table
from dqslam.io.formats import Format


def read_open3d(path: str | Path, *, camera_id: str | None = None) -> _core.Camera:
    """Read a camera of Open3D."""
    table = read_json_table(path)
    views = table.values.get("parameters")
    if isinstance(views, list):
        different: list[Any] = []
        for view in views:
            intrinsic = view.get("intrinsic") if isinstance(view, dict) else None
            if not isinstance(intrinsic, dict):
                raise table.error("parameters has an entry without intrinsic", "parameters")
            if intrinsic not in different:
                different.append(intrinsic)
        if not different:
            raise table.error("parameters is empty", "parameters")
        cameras = {str(number): table.part(one) for number, one in enumerate(different)}
        return camera_of_names(choose_camera(path, cameras, camera_id))
    intrinsic = table.values.get("intrinsic")
    one = table.part(intrinsic) if isinstance(intrinsic, dict) else table
    return camera_of_names(choose_camera(path, {"0": one}, camera_id))


OPEN3D = Format(
    "open3d",
    "a .json with intrinsic_matrix",
    lambda look: look.suffix == ".json" and '"intrinsic_matrix"' in look.head,
    read_open3d,
)
