"""Cameras from JSON or TOML, under the names that programs use.

dqslam writes ``fx fy cx cy`` px, ``width height`` px, and the lens: ``k1 k2 p1 p2 k3`` of OpenCV,
or a ``model`` and its coefficients by name. Other spellings are read, too: see docs/formats.md.
Integer pixel coordinates are pixel centers, so the image spans [-0.5, width - 0.5] in x.
"""

from __future__ import annotations

from pathlib import Path

from dqslam import _core
from dqslam.io.camera.build import INTRINSICS
from dqslam.io.camera.look import is_toml
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import read_json_table, read_toml_table
from dqslam.io.files import write_json, write_text
from dqslam.io.formats import Format
from dqslam.lens import lens_of


def read_json(path: str | Path) -> _core.Camera:
    """Read a camera from JSON."""
    return camera_of_names(read_json_table(path))


def read_toml(path: str | Path) -> _core.Camera:
    """Read a camera from TOML."""
    return camera_of_names(read_toml_table(path))


def write_json_camera(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as JSON, without loss of a bit."""
    write_json(path, named_values(camera))


def write_toml(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as TOML, without loss of a bit."""
    lines = (
        f"{key} = {value!r}\n" if not isinstance(value, str) else f'{key} = "{value}"\n'
        for key, value in named_values(camera).items()
    )
    write_text(path, "".join(lines))


def named_values(camera: _core.Camera) -> dict[str, float | str]:
    """Return what a file says of a camera: intrinsics, and the lens unless it is ideal."""
    values: dict[str, float | str] = {key: getattr(camera, key) for key in INTRINSICS}
    lens = lens_of(camera)
    if lens.is_ideal:
        return values
    if lens.model != "plumb_bob":
        values["model"] = lens.model
    return values | dict(zip(lens.names, lens.parameters, strict=True))


JSON = Format(
    "json",
    "its name ends in .json",
    lambda look: look.suffix == ".json",
    read_json,
    write_json_camera,
    endings=(".json",),
)
TOML = Format(
    "toml",
    "its name ends in .toml",
    is_toml,
    read_toml,
    write_toml,
    endings=(".toml",),
)
