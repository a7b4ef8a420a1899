"""Cameras from ROS: the YAML of camera_calibration (camera_info), and a CameraInfo as printed.

``camera_matrix`` (or K, k) and ``distortion_coefficients`` (or D, d) belong to the raw image of the
full sensor, with integer pixel coordinates at pixel centers. A region of interest and binning are
applied as image_geometry does: offsets are subtracted, then all is divided. The models are
plumb_bob, rational_polynomial, equidistant and fov. Boxes in a rectified image need the camera of
``projection_matrix`` without distortion, which is not read here.
This needs PyYAML: pip install 'dqslam[yaml]'.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from dqslam import _core
from dqslam.io.camera.look import is_yaml
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import Table, read_yaml_table
from dqslam.io.files import FileError, write_text
from dqslam.io.formats import Format
from dqslam.lens import lens_of

# Keys of the message that are no part of the raw image's camera, or are used by `_reduced`.
_BESIDE = (
    *("header", "rectification_matrix", "R", "r", "P", "p", "projection_matrix", "roi"),
    *("binning_x", "binning_y", "camera_name"),
)
_MODELS = {
    "plumb_bob": "plumb_bob",
    "rational": "rational_polynomial",
    "thin_prism": "rational_polynomial",
    "equidistant": "equidistant",
    "fov": "fov",
}


def read_ros(path: str | Path) -> _core.Camera:
    """Read a camera_info."""
    return camera_of_info(read_yaml_table(path))


def camera_of_info(table: Table) -> _core.Camera:
    """Make a camera from the fields of a camera_info."""
    return camera_of_names(
        table, harmless=_BESIDE, transform=lambda values: _reduced(table, values)
    )


def _reduced(table: Table, values: dict[str, float]) -> dict[str, float]:
    """Apply the region of interest, then binning, in which 0 is 1."""
    region = table.values.get("roi") or {}
    if not isinstance(region, Mapping):
        raise table.error("roi is no table", "roi")
    reduced = dict(values)
    of_region = table.part(region)
    for size, offset, center, focal, binning in (
        ("width", "x_offset", "cx", "fx", "binning_x"),
        ("height", "y_offset", "cy", "fy", "binning_y"),
    ):
        start = _whole(of_region, offset)
        length = _whole(of_region, size) or values[size]  # 0 is all of it
        if start + length > values[size]:
            if _whole(of_region, size):
                message = f"roi ends at {start + length:g}, beyond {size} {values[size]:g}"
                raise table.error(message, "roi")
            length = values[size] - start
        divisor = max(1.0, _whole(table, binning))
        reduced[center] = (values[center] - start) / divisor
        reduced[focal] = values[focal] / divisor
        reduced[size] = length // divisor if divisor > 1 else length
    return reduced


def _whole(table: Table, key: str) -> float:
    if table.values.get(key) is None:
        return 0.0
    value = table.number(key)
    if value < 0 or value != int(value):
        raise table.error(f"{key} is {value:g}, not a whole number from 0", key)
    return value


def write_ros(path: str | Path, camera: _core.Camera) -> None:
    """Write a camera as camera_calibration does."""
    lens = lens_of(camera)
    if lens.model not in _MODELS:
        raise FileError(path, f"ros has no place for the lens model {lens.model}")
    matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    projection = [*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0]
    identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    blocks: tuple[tuple[str, int, int, list[float]], ...] = (
        ("camera_matrix", 3, 3, matrix),
        ("distortion_coefficients", 1, len(lens.parameters), list(lens.parameters)),
        ("rectification_matrix", 3, 3, identity),
        ("projection_matrix", 3, 4, projection),
    )
    lines = [
        f"image_width: {camera.width}",
        f"image_height: {camera.height}",
        "camera_name: camera",
    ]
    lines.append(f"distortion_model: {_MODELS[lens.model]}")
    for name, rows, columns, data in blocks:
        # In YAML 1.1 a number needs a point: 1e-05 is text.
        cells = ", ".join(_decimal(value) for value in data)
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{cells}]"]
    write_text(path, "\n".join(lines) + "\n")


def _decimal(value: float) -> str:
    text = repr(value)
    mantissa, e, exponent = text.partition("e")
    return text if not e or "." in mantissa else f"{mantissa}.0e{exponent}"


ROS = Format(
    "ros",
    "its name ends in .yaml or .yml",
    lambda look: look.is_text and is_yaml(look),
    read_ros,
    write_ros,
    endings=(".yaml", ".yml"),
)
