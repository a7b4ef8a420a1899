"""Cameras from OpenCV's FileStorage, YAML or XML, as its calibration sample writes them.

``camera_matrix``, ``distortion_coefficients`` (4, 5, 8, 12 or 14 numbers; with ``fisheye_model: 1``
the 4 of cv::fisheye), ``image_width`` and ``image_height``. The names of stereo calibration, M1 D1
M2 D2, are cameras with the ids 1 and 2. Integer pixel coordinates are pixel centers.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from dqslam import _core
from dqslam.io.camera.build import choose_camera
from dqslam.io.camera.look import is_xml, is_yaml
from dqslam.io.camera.named import camera_of_names
from dqslam.io.camera.tables import Table, read_yaml_table
from dqslam.io.files import FileError, read_text
from dqslam.io.formats import Format, Look

# The matrices of the cameras of a pair: M1, camera_matrix_1, cameraMatrix2, D1, dist_coeffs_2.
_OF_PAIR = re.compile(r"(?P<name>[A-Za-z_]*[A-Za-z])_?(?P<id>[12])")
_MATRIX = ("rows", "cols", "data")


def read_opencv(path: str | Path, *, camera_id: str | None = None) -> _core.Camera:
    """Read a camera of a FileStorage."""
    text = read_text(path)
    table = _read_xml(path, text) if text.lstrip().startswith("<") else read_yaml_table(path)
    pair: dict[str, dict[str, Any]] = {}
    single: dict[str, Any] = {}
    for key, value in table.values.items():
        match = _OF_PAIR.fullmatch(str(key))
        if match and isinstance(value, dict) and set(_MATRIX) <= set(value):
            pair.setdefault(match["id"], {})[match["name"]] = value
        else:
            single[key] = value
    if not pair:
        return camera_of_names(choose_camera(path, {"1": table}, camera_id))
    of_both = {key: single[key] for key in single if not isinstance(single[key], dict)}
    kept = ("M", "D", "K")  # R1, P1 and the like are those of rectification
    cameras = {
        one: table.part(
            of_both | {key: value for key, value in values.items() if key in kept or len(key) > 1}
        )
        for one, values in sorted(pair.items())
    }
    return camera_of_names(choose_camera(path, cameras, camera_id))


def _read_xml(path: str | Path, text: str) -> Table:
    if "<!DOCTYPE" in text:  # entities of entities make a small file endless
        raise FileError(path, "has a document type: not read")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise FileError(path, f"not XML: {error.msg}", error.position[0]) from None
    except (ValueError, RecursionError) as error:
        raise FileError(path, f"not XML: {error}") from None
    values = _values(root)
    if not isinstance(values, dict):
        raise FileError(path, "holds no table of named values")
    return Table(path, text, values, number_texts=True)


def _values(node: ElementTree.Element) -> Any:
    """Return the table of a node with named parts, or its text."""
    parts = [child for child in node if child.tag != "_"]
    if parts:
        return {child.tag: _values(child) for child in parts}
    text = (node.text or "").strip()
    return int(text) if text.isdecimal() else text


def _looks(look: Look) -> bool:
    start = look.head
    if is_xml(look):
        return "<opencv_storage>" in start
    return is_yaml(look) and ("!!opencv-matrix" in start or start.startswith("%YAML:"))


OPENCV = Format(
    "opencv",
    "a .yaml that starts with %YAML:, or an .xml with <opencv_storage>",
    _looks,
    read_opencv,
)
