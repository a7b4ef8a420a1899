"""What has changed between two maps, as files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats, as_covariances, as_floats
from dqslam.io.files import FileError, read_text, write_json, write_text
from dqslam.places.changes.comparison import STATUSES, Change, Changes
from dqslam.places.changes.frames import covariance_in_b

_COLUMNS = (
    *("status", "probability", "first_id", "second_id", "class_name"),
    *("x1", "y1", "z1", "x2", "y2", "z2", "distance", "sigma", "significance", "looks"),
)
CHANGES_FILE = "changes.json"
# Poses of cameras in the file, at most: enough to draw their path.
_MOST_CAMERAS = 300


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
    step = -(-max(len(found.cameras), 1) // _MOST_CAMERAS)
    cameras = {"cameras": found.cameras[::step]}
    write_json(folder / CHANGES_FILE, described(found) | cameras)


def read_changes(path: str | Path) -> Changes:
    """Read ``changes.json``; the cameras are those that it has, evenly spread.

    Raises
    ------
    FileError
        If the file is missing or wrong; the error names the row of an object.
    """
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    rows = content.get("objects") if isinstance(content, dict) else None
    if not isinstance(rows, list):
        raise FileError(path, "has no list of objects")
    found = []
    for row, entry in enumerate(rows):
        try:
            found.append(_change(entry))
        except KeyError as error:
            raise FileError(path, f"objects row {row}: no {error.args[0]}") from None
        except (ValueError, TypeError) as error:
            raise FileError(path, f"objects row {row}: {error}") from None
    try:
        pose = as_floats("second_from_first", content.get("second_from_first"), [4, 4])
        cameras = as_floats("cameras", content.get("cameras") or np.zeros((0, 7)), [None, 7])
    except ValueError as error:
        raise FileError(path, str(error)) from None
    return Changes(tuple(found), pose, cameras, str(content.get("frame", "")))


def _change(entry: dict[str, Any]) -> Change:
    """Return an object of the file."""
    if entry["status"] not in STATUSES:
        raise ValueError(f"status is {entry['status']!r}, not one of {', '.join(STATUSES)}")
    size = as_floats("size", entry["size"], [])
    if not size > 0.0:
        raise ValueError(f"size is {size:g} m, not positive")
    shapes = {"first_center": [3], "second_center": [3], "displacement": [3], "covariance": [3, 3]}
    arrays = {
        name: None if entry[name] is None else as_floats(name, entry[name], list(shape))
        for name, shape in shapes.items()
    }
    ids = {
        name: None if entry[name] is None else int(entry[name])
        for name in ("first_id", "second_id")
    }
    for name in ("first", "second"):
        if (ids[f"{name}_id"] is None) != (arrays[f"{name}_center"] is None):
            raise ValueError(f"has one of {name}_id and {name}_center without the other")
    if arrays["first_center"] is None and arrays["second_center"] is None:
        raise ValueError("has neither first_center nor second_center")
    significance = entry["significance"]
    return Change(
        status=entry["status"],
        probability=float(entry["probability"]),
        class_name=str(entry["class_name"]),
        significance=None if significance is None else float(significance),
        size=float(size),
        looks=float(entry["looks"]),
        first_id=ids["first_id"],
        second_id=ids["second_id"],
        first_center=arrays["first_center"],
        second_center=arrays["second_center"],
        displacement=arrays["displacement"],
        covariance=arrays["covariance"],
    )


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
