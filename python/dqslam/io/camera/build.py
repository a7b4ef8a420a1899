"""The checks that all camera formats share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from dqslam import _core
from dqslam.io.files import FileError

INTRINSICS = ("fx", "fy", "cx", "cy", "width", "height")
DISTORTION = ("k1", "k2", "p1", "p2", "k3")
LARGEST_IMAGE = 1_000_000

LineOf = Callable[[str], int | None]


def make_camera(
    path: str | Path,
    values: Mapping[str, float],
    distortion: Sequence[float],
    line_of: LineOf,
) -> _core.Camera:
    """Make a camera of finite INTRINSICS and DISTORTION; ``line_of`` finds the line of a name."""
    for key in ("fx", "fy", "width", "height"):
        if values[key] <= 0:
            raise FileError(path, f"{key} is {values[key]:g}, not positive", line_of(key))
    for key in ("width", "height"):
        if values[key] != math.floor(values[key]) or values[key] > LARGEST_IMAGE:
            message = f"{key} is {values[key]:g}, not a whole number of pixels up to 1e6"
            raise FileError(path, message, line_of(key))
    return _core.Camera(
        values["fx"],
        values["fy"],
        values["cx"],
        values["cy"],
        int(values["width"]),
        int(values["height"]),
        distortion=list(distortion),
    )
