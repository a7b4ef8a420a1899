"""What has changed between two maps, as files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats, as_covariances, as_floats
from dqslam.io.files import FileError, read_text, write_json, write_text
from dqslam.places.changes import Change, Changes
from dqslam.places.changes_frames import covariance_in_b

_COLUMNS = (
    *("status", "probability", "first_id", "second_id", "class_name"),
    *("x1", "y1", "z1", "x2", "y2", "z2", "distance", "sigma", "significance", "looks"),
)


def read_alignment(path: str | Path) -> tuple[Floats, Floats | None]:
    """Read ``b_from_a`` (4, 4) and, if it is there, ``covariance`` (6, 6) from a JSON file.

    In the file, the covariance is of a small motion in the frame of A, as ``dqslam align`` writes
    it. It may be 0 for roll and pitch. What is returned is in the frame of B.

    Raises
    ------
    FileError
        If the file is missing or has no such numbers.
    """
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    if not isinstance(content, dict) or "b_from_a" not in content:
        raise FileError(path, "has no b_from_a")
    try:
        pose = as_floats("b_from_a", content["b_from_a"], [4, 4])
        if content.get("covariance") is None:
            return pose, None
        given = as_floats("covariance", content["covariance"], [6, 6])
        return pose, as_covariances("covariance", [covariance_in_b(pose, given)], 1, 6)[0]
    except ValueError as error:
        raise FileError(path, str(error)) from None


def write_changes(folder: Path, found: Changes) -> None:
    """Write ``changes.csv``, a row for each object, and ``changes.json`` into a folder."""
    rows = [",".join(_COLUMNS), *(",".join(_cells(one)) for one in found.objects)]
    write_text(folder / "changes.csv", "\n".join(rows) + "\n")
    write_json(folder / "changes.json", described(found))


def described(found: Changes) -> dict[str, Any]:
    """Return changes as plain data."""
    return {
        "second_from_first": found.second_from_first,
        "frame": found.frame,
        "objects": [vars(one) for one in found.objects],
    }


def distance_and_sigma(one: Change) -> tuple[float, float]:
    """Return how far an object moved, and the sigma of that along the way, meters; NaN if unknown.

    Without a motion, the sigma is the largest of any direction.
    """
    if one.displacement is None or one.covariance is None:
        return np.nan, np.nan
    distance = float(np.linalg.norm(one.displacement))
    if distance == 0.0:
        return 0.0, float(np.sqrt(np.linalg.eigvalsh(one.covariance)[-1]))
    way = one.displacement / distance
    return distance, float(np.sqrt(way @ one.covariance @ way))


def _cells(one: Change) -> list[str]:
    nowhere = np.full(3, np.nan)
    first = nowhere if one.first_center is None else one.first_center
    second = nowhere if one.second_center is None else one.second_center
    significance = np.nan if one.significance is None else one.significance
    numbers = [*first, *second, *distance_and_sigma(one), significance, one.looks]
    ids = ["" if number is None else str(number) for number in (one.first_id, one.second_id)]
    name = one.class_name
    quoted = '"' + name.replace('"', '""') + '"' if set(name) & set(',"\n') else name
    return [
        one.status,
        f"{one.probability:.6f}",
        *ids,
        quoted,
        *("" if np.isnan(x) else f"{x:.6g}" for x in numbers),
    ]
