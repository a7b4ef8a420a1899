"""The pose of the camera in the body of the trajectory: body_from_camera, meters.

The file is a text with 7 numbers ``tx ty tz qx qy qz qw``, or with the 12 or 16 numbers of a matrix
[R t], row by row, separated by spaces, commas or brackets. Or it is EuRoC's camera ``sensor.yaml``
with ``T_BS``.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dqslam._input import plain_name
from dqslam.io.files import FileError, parse_numbers, read_rows, read_text
from dqslam.io.yaml import parse_yaml

TOLERANCE = 1e-3


def read_mount(path: str | Path) -> NDArray[np.float64]:
    """Read body_from_camera, shape (7,): m, unit quaternion x y z w."""
    from scipy.spatial.transform import Rotation

    if Path(plain_name(path)).suffix.lower() in (".yaml", ".yml"):
        entry = parse_yaml(path, read_text(path)).get("T_BS")
        data = entry.get("data") if isinstance(entry, dict) else entry
        if not isinstance(data, list):
            raise FileError(path, "has no matrix T_BS")
        cells, lines = [str(value) for value in data], [1] * len(data)
    else:
        numbered = zip(*read_rows(path), strict=True)
        split = [(cell, line) for row, line in numbered for cell in re.split(r"[\s,;\[\]]+", row)]
        cells = [cell for cell, _ in split if cell]
        lines = [line for cell, line in split if cell]
    values = parse_numbers(path, "a number", cells, lines)
    if values.size == 7:
        norm = np.linalg.norm(values[3:])
        if abs(norm - 1) > TOLERANCE:
            raise FileError(path, f"quaternion has length {norm:.6g}, not 1")
        return np.concatenate([values[:3], values[3:] / norm])
    if values.size not in (12, 16):
        raise FileError(path, f"holds {values.size} numbers, not 7, 12 or 16")
    matrix = values.reshape(-1, 4)
    rotation = matrix[:3, :3]
    off = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if (
        off > TOLERANCE
        or np.linalg.det(rotation) < 0
        or matrix[3:].tolist()
        not in (
            [],
            [[0, 0, 0, 1]],
        )
    ):
        raise FileError(path, "is no rotation and translation [R t]")
    quaternion = Rotation.from_matrix(rotation).as_quat(canonical=True)
    return np.concatenate([matrix[:3, 3], quaternion])
