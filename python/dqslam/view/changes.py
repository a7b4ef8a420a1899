"""What has changed since an earlier map, in the scene of the later one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats, as_floats
from dqslam._colors import GRAY, GREEN, ORANGE, SKY, VERMILLION
from dqslam.io.files import FileError, read_text
from dqslam.view.scene import Scene, SceneObject

COLORS = {
    "stayed": GRAY,
    "moved": ORANGE,
    "vanished": VERMILLION,
    "appeared": GREEN,
    "unknown": SKY,
}


def with_changes(scene: Scene, path: str | Path) -> Scene:
    """Return the scene of the later map with what ``changes.json`` says of its objects.

    Objects are named and colored by what became of them. Those that only the earlier map has, and
    the places that moved objects have left, are objects, too: spheres of their mean semi-axis. Any
    viewer shows them, and the page hides and finds them as classes.

    Raises
    ------
    FileError
        If the file is missing or wrong, or names objects that the scene does not have.
    """
    rows = _read(path)
    row_of = {one.id: row for row, one in enumerate(scene.objects)}
    objects, before = list(scene.objects), []
    for row, entry in enumerate(rows):
        try:
            status, name = str(entry["status"]), str(entry["class_name"])
            color = COLORS[status]
            told = (("change", _described(entry)),)
            second = entry["second_id"]
            if second is not None:
                if second not in row_of:
                    raise ValueError(f"object {second} is not in the map: it is of another one")
                place = row_of[second]
                objects[place] = replace(
                    objects[place],
                    class_name=f"{objects[place].class_name}: {status}",
                    color=color,
                    numbers=(*told, *objects[place].numbers),
                )
            if second is None or status == "moved":
                left = status if second is None else "left"
                center = as_floats("first_center", entry["first_center"], [3])
                size = float(entry["size"])
                before.append(
                    _sphere(int(entry["first_id"]), f"{name}: {left}", color, center, size, told)
                )
        except KeyError as error:
            raise FileError(path, f"objects row {row}: no {error.args[0]}") from None
        except (ValueError, TypeError) as error:
            raise FileError(path, f"objects row {row}: {error}") from None
    counts = [(f"{sum(one.get('status') == status for one in rows)}", status) for status in COLORS]
    total = ", ".join(f"{count} {status}" for count, status in counts if count != "0")
    overview = (*scene.overview, ("changes", total))
    return replace(scene, objects=(*objects, *before), overview=overview)


def _read(path: str | Path) -> list[dict[str, Any]]:
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    rows = content.get("objects") if isinstance(content, dict) else None
    if not isinstance(rows, list) or not all(isinstance(one, dict) for one in rows):
        raise FileError(path, "has no list of objects")
    return rows


def _described(entry: dict[str, Any]) -> str:
    text = f"{entry['status']}, probability {float(entry['probability']):.3f}"
    if entry["status"] == "moved":
        distance = np.linalg.norm(as_floats("displacement", entry["displacement"], [3]))
        text += f", by {distance:.3g} m"
    return text


def _sphere(
    number: int, name: str, color: str, center: Floats, size: float, numbers: Any
) -> SceneObject:
    return SceneObject(
        id=number,
        class_name=name,
        color=color,
        center=center,
        semi_axes=np.full(3, size),
        orientation_xyzw=np.array([0.0, 0.0, 0.0, 1.0]),
        center_covariance=None,
        numbers=numbers,
    )
