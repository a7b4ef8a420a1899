"""Cameras from JSON or TOML.

The keys are ``fx fy cx cy`` px, ``width height`` px, and optionally OpenCV's five numbers of lens
distortion: as ``k1 k2 p1 p2 k3``, or as a list in that order under ``distortion`` or
``dist_k1k2p1p2k3``, or as a table ``distortion``. Other keys are ignored.
Integer pixel coordinates are pixel centers, so the image spans [-0.5, width - 0.5] in x.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.io.camera.build import DISTORTION, INTRINSICS, make_camera
from dqslam.io.files import FileError, read_text, write_json, write_text
from dqslam.io.formats import Format

DISTORTION_LISTS = ("distortion", "dist_k1k2p1p2k3")
# Reading these as a pinhole with radial and tangential distortion would be wrong, silently.
OTHER_MODELS = ("fisheye", "equidistant", "kannala", "omni", "double_sphere", "rational", "fov")


def read_json(path: str | Path) -> _core.Camera:
    """Read a camera from JSON."""
    return _read(path, toml=False)


def read_toml(path: str | Path) -> _core.Camera:
    """Read a camera from TOML."""
    return _read(path, toml=True)


def write_json_camera(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as JSON, without loss of a bit."""
    write_json(path, _values(camera))


def write_toml(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as TOML, without loss of a bit."""
    write_text(path, "".join(f"{key} = {value!r}\n" for key, value in _values(camera).items()))


def _values(camera: _core.Camera) -> dict[str, float]:
    values = {key: getattr(camera, key) for key in INTRINSICS}
    if camera.has_distortion:
        values |= dict(zip(DISTORTION, camera.distortion.tolist(), strict=True))
    return values


def _read(path: str | Path, *, toml: bool) -> _core.Camera:
    text = read_text(path)
    table = _parse(path, text, toml=toml)
    missing = [key for key in INTRINSICS if key not in table]
    if missing:
        raise FileError(path, f"missing {', '.join(missing)} (it has: {', '.join(table)})")
    model = table.get("model")
    if isinstance(model, str) and any(name in model.lower() for name in OTHER_MODELS):
        message = f"model is {model}; only pinhole with k1 k2 p1 p2 k3 is known"
        raise FileError(path, message, _line_of(text, "model"))
    values = {key: _number(path, text, key, table[key]) for key in INTRINSICS}
    distortion = _distortion(path, text, table)
    return make_camera(path, values, distortion, lambda key: _line_of(text, key))


def _parse(path: str | Path, text: str, *, toml: bool) -> dict[str, Any]:
    try:
        table: Any = tomllib.loads(text) if toml else json.loads(text)
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    except tomllib.TOMLDecodeError as error:
        at = re.search(r"\(at line (\d+)", str(error))
        message = f"not TOML: {str(error).split(' (at ')[0]}"
        raise FileError(path, message, int(at[1]) if at else None) from None
    except RecursionError:
        raise FileError(path, "nested too deeply") from None
    if not isinstance(table, dict):
        raise FileError(path, "holds no table of named values")
    return table


def _distortion(path: str | Path, text: str, table: dict[str, Any]) -> list[float]:
    given = [key for key in DISTORTION_LISTS if key in table]
    named = [key for key in DISTORTION if key in table]
    if len(given) + bool(named) > 1:
        message = f"distortion is given twice: {', '.join([*given, *named])}"
        raise FileError(path, message, _line_of(text, (given + named)[1]))
    source: Any = table[given[0]] if given else table
    if isinstance(source, dict):
        unknown = [key for key in source if given and key not in DISTORTION]
        if unknown:
            message = f"{given[0]} knows no {unknown[0]}, only {' '.join(DISTORTION)}"
            raise FileError(path, message, _line_of(text, unknown[0]))
        return [_number(path, text, key, source.get(key, 0.0)) for key in DISTORTION]
    # Four numbers are OpenCV's shorter form, without k3.
    if not isinstance(source, list) or len(source) not in (4, 5):
        message = f"{given[0]} is not a list of 4 or 5 numbers: {' '.join(DISTORTION)}"
        raise FileError(path, message, _line_of(text, given[0]))
    return [_number(path, text, given[0], value) for value in (*source, 0.0)[:5]]


def _number(path: str | Path, text: str, key: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FileError(path, f"{key} is {value!r}, not a number", _line_of(text, key))
    if not math.isfinite(value):
        raise FileError(path, f"{key} is {value}, not finite", _line_of(text, key))
    return float(value)


def _line_of(text: str, key: str) -> int | None:
    """Find the first line that sets a key, or None if there is no such line."""
    for number, line in enumerate(text.split("\n"), start=1):
        if re.search(rf"(?<![\w-])[\"']?{re.escape(key)}[\"']?\s*(?:[:=\]])", line):
            return number
    return None


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
    lambda look: look.suffix == ".toml",
    read_toml,
    write_toml,
    endings=(".toml",),
)
