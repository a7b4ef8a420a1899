"""Cameras from ROS: the YAML of camera_calibration (camera_info), and a CameraInfo as printed.

``camera_matrix`` (or K, k) and ``distortion_coefficients`` (or D, d) belong to the raw image and
the model ``plumb_bob``, k1 k2 p1 p2 k3, with integer pixel coordinates at pixel centers. Boxes in a
rectified image need the camera of ``projection_matrix`` without distortion, which is not read here.
This needs PyYAML: pip install 'dqslam[yaml]'.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

from dqslam import _core
from dqslam.io.camera.build import make_camera
from dqslam.io.files import FileError, read_text, write_text
from dqslam.io.formats import Format, Look
from dqslam.io.yaml import parse_yaml

# The names in the calibration file, in ROS 1's message and in ROS 2's.
NAMES = {
    "width": ("image_width", "width"),
    "height": ("image_height", "height"),
    "K": ("camera_matrix", "K", "k"),
    "D": ("distortion_coefficients", "D", "d"),
}
MODELS = ("plumb_bob", "rational_polynomial", "")


def read_ros(path: str | Path) -> _core.Camera:
    """Read a camera_info."""
    text = read_text(path)
    return camera_of_info(path, parse_yaml(path, text), text)


def camera_of_info(path: str | Path, table: dict[str, Any], text: str = "") -> _core.Camera:
    """Make a camera from the fields of a camera_info; its text gives the lines for errors."""

    def line_of(key: str) -> int | None:
        for number, line in enumerate(text.split("\n"), start=1):
            if re.match(rf"\s*{re.escape(key)}\s*:", line):
                return number
        return None

    keys = {}
    for name, spellings in NAMES.items():
        found = [key for key in spellings if key in table]
        if not found:
            message = f"missing {' or '.join(spellings)} (it has: {', '.join(map(str, table))})"
            raise FileError(path, message)
        keys[name] = found[0]
    model = str(table.get("distortion_model") or "")
    if model not in MODELS:
        message = f"distortion_model is {model}; only plumb_bob is known"
        raise FileError(path, message, line_of("distortion_model"))
    values = {
        name: _numbers(path, keys[name], [table[keys[name]]], line_of)[0]
        for name in ("width", "height")
    }
    matrix = _data(path, keys["K"], table[keys["K"]], line_of)
    if len(matrix) != 9 or (matrix[1], matrix[3], *matrix[6:]) != (0, 0, 0, 0, 1):
        message = f"{keys['K']} is not fx 0 cx, 0 fy cy, 0 0 1"
        raise FileError(path, message, line_of(keys["K"]))
    values |= {"fx": matrix[0], "cx": matrix[2], "fy": matrix[4], "cy": matrix[5]}
    distortion = _data(path, keys["D"], table[keys["D"]], line_of)
    # Four numbers are OpenCV's shorter form; more than five are the rational model.
    if len(distortion) not in (0, 4, 5, 8, 12, 14) or any(distortion[5:]):
        message = f"{keys['D']} is not k1 k2 p1 p2 k3, further ones zero"
        raise FileError(path, message, line_of(keys["D"]))
    five = (distortion + [0.0] * 5)[:5]
    spelt = {"fx": keys["K"], "fy": keys["K"], "width": keys["width"], "height": keys["height"]}
    return make_camera(path, values, five, lambda key: line_of(spelt[key]))


def write_ros(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as camera_calibration does."""
    matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    projection = [*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0]
    identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    blocks = (
        ("camera_matrix", 3, 3, matrix),
        ("distortion_coefficients", 1, 5, camera.distortion.tolist()),
        ("rectification_matrix", 3, 3, identity),
        ("projection_matrix", 3, 4, projection),
    )
    lines = [
        f"image_width: {camera.width}",
        f"image_height: {camera.height}",
        "camera_name: camera",
    ]
    lines.append("distortion_model: plumb_bob")
    for name, rows, columns, data in blocks:
        # In YAML 1.1 a number needs a point: 1e-05 is text.
        cells = ", ".join(_decimal(value) for value in data)
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{cells}]"]
    write_text(path, "\n".join(lines) + "\n")


def _decimal(value: float) -> str:
    text = repr(value)
    mantissa, e, exponent = text.partition("e")
    return text if not e or "." in mantissa else f"{mantissa}.0e{exponent}"


def _data(path: str | Path, key: str, value: Any, line_of: Any) -> list[float]:
    numbers = value.get("data") if isinstance(value, dict) else value
    if numbers is None:
        numbers = []
    if not hasattr(numbers, "__iter__") or isinstance(numbers, str):
        raise FileError(path, f"{key} is no list of numbers", line_of(key))
    return _numbers(path, key, list(numbers), line_of)


def _numbers(path: str | Path, key: str, values: list[Any], line_of: Any) -> list[float]:
    numbers = []
    for value in values:
        try:
            # YAML 1.1 reads 1e-05 as text.
            number = math.nan if isinstance(value, bool) else float(value)
        except (TypeError, ValueError):
            raise FileError(path, f"{key} holds {value!r}, not a number", line_of(key)) from None
        if not math.isfinite(number):
            raise FileError(path, f"{key} holds {value}, not finite", line_of(key))
        numbers.append(number)
    return numbers


def _looks(look: Look) -> bool:
    return look.suffix in (".yaml", ".yml") and look.path.is_file()


ROS = Format(
    "ros",
    "its name ends in .yaml or .yml",
    _looks,
    read_ros,
    write_ros,
    endings=(".yaml", ".yml"),
)
