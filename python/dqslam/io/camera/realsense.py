"""Cameras from intrinsics of a RealSense as JSON: ``width height ppx ppy fx fy model coeffs``.

They may be those of several streams, by their names: ``color``, ``depth``; these are ids. Integer
pixel coordinates are pixel centers. Of the models, *Brown Conrady*, *Kannala Brandt4* and *F-Theta*
are lenses here; *Modified Brown Conrady* is one without tangential coefficients, and *Inverse Brown
Conrady* only if all are zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.io.camera.build import choose_camera
from dqslam.io.camera.lenses import plain
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import Table, read_json_table
from dqslam.io.files import FileError
from dqslam.io.formats import Format


def read_realsense(path: str | Path, *, camera_id: str | None = None) -> _core.Camera:
    """Read a camera of a RealSense."""
    table = read_json_table(path)
    streams = dict(_streams("0", table.values))
    if not streams:
        raise FileError(path, "has no ppx and ppy")
    values = choose_camera(path, streams, camera_id)
    return _camera(table.part(values))


def _camera(table: Table) -> _core.Camera:
    model, values = str(table.values.get("model", "")), dict(table.values)
    coefficients = table.numbers("coeffs") if "coeffs" in values else []
    word = plain(model).removeprefix("distortion")
    if word == "inversebrownconrady" and not any(coefficients):
        values["model"] = "none"
    if word == "modifiedbrownconrady" and any(coefficients[2:4]):
        message = f"model is {model}, whose tangential coefficients are of a lens not known here"
        raise table.error(message, "coeffs")
    if word in ("ftheta", "kannalabrandt4"):
        # The list has five places whatever the model.
        values["coeffs"] = coefficients[: 1 if word == "ftheta" else 4]
    return camera_of_names(table.part(values))


def _streams(name: str, values: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any]]]:
    """Return the tables with ppx, by the name of the table or of the stream that it is in."""
    if "ppx" in values:
        return [(name, values)]
    found = []
    for key, value in values.items():
        if isinstance(value, dict):
            found += _streams(name if plain(key) == "intrinsics" else key, value)
    return found


REALSENSE = Format(
    "realsense",
    "a .json with ppx and ppy",
    lambda look: look.suffix == ".json" and '"ppx"' in look.head,
    read_realsense,
)
