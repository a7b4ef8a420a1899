"""The checks that all camera formats share, and the choice of one of several cameras."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from dqslam import _core
from dqslam.io.files import FileError
from dqslam.lens import Lens, camera_with

INTRINSICS = ("fx", "fy", "cx", "cy", "width", "height")
LARGEST_IMAGE = 1_000_000

LineOf = Callable[[str], int | None]
Entry = TypeVar("Entry")


def make_camera(
    path: str | Path, values: Mapping[str, float], lens: Lens, line_of: LineOf
) -> _core.Camera:
    """Make a camera of finite INTRINSICS and a lens; ``line_of`` finds the line of a name."""
    for key in ("fx", "fy", "width", "height"):
        if values[key] <= 0:
            raise FileError(path, f"{key} is {values[key]:g}, not positive", line_of(key))
    for key in ("width", "height"):
        if values[key] != math.floor(values[key]) or values[key] > LARGEST_IMAGE:
            message = f"{key} is {values[key]:g}, not a whole number of pixels up to 1e6"
            raise FileError(path, message, line_of(key))
    for key, size in (("cx", "width"), ("cy", "height")):
        if not -values[size] < values[key] < 2 * values[size]:
            message = f"{key} is {values[key]:g}, far from an image with {size} {values[size]:g}"
            raise FileError(path, message, line_of(key))
    pinhole = _core.Camera(
        values["fx"],
        values["fy"],
        values["cx"],
        values["cy"],
        int(values["width"]),
        int(values["height"]),
    )
    return camera_with(pinhole, lens)


def choose_camera(path: str | Path, cameras: Mapping[str, Entry], camera_id: str | None) -> Entry:
    """Return one of the cameras of a file by its id; a single one needs no id."""
    ids = ", ".join(cameras)
    if camera_id is not None:
        if camera_id not in cameras:
            raise FileError(path, f"has no camera {camera_id} (it has: {ids})")
        return cameras[camera_id]
    if len(cameras) != 1:
        message = f"holds {len(cameras)} cameras, {ids}: choose one with --camera-id"
        raise FileError(path, message)
    return next(iter(cameras.values()))
