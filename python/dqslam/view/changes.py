"""What has changed since an earlier map, in the scene of the later one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import GRAY, GREEN, ORANGE, SKY, VERMILLION
from dqslam.io.files import FileError
from dqslam.places.changes import STATUSES, Change, read_changes
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
    found = read_changes(path)
    row_of = {one.id: row for row, one in enumerate(scene.objects)}
    objects, before = list(scene.objects), []
    for row, one in enumerate(found.objects):
        color, told = COLORS[one.status], (("change", _described(one)),)
        if one.second_id is not None:
            if one.second_id not in row_of:
                message = f"object {one.second_id} is not in the map: it is of another one"
                raise FileError(path, f"objects row {row}: {message}")
            place = row_of[one.second_id]
            objects[place] = replace(
                objects[place],
                class_name=f"{objects[place].class_name}: {one.status}",
                color=color,
                numbers=(*told, *objects[place].numbers),
            )
        if one.first_id is None or one.first_center is None:
            continue
        if one.second_id is None or one.status == "moved":
            name = f"{one.class_name}: {one.status if one.second_id is None else 'left'}"
            before.append(_sphere(one.first_id, name, color, one.first_center, one.size, told))
    counts = [(len(found.of(status)), status) for status in STATUSES]
    total = ", ".join(f"{count} {status}" for count, status in counts if count)
    overview = (*scene.overview, ("changes", total))
    return replace(scene, objects=(*objects, *before), overview=overview)


def _described(one: Change) -> str:
    text = f"{one.status}, probability {one.probability:.3f}"
    if one.displacement is not None and one.status == "moved":
        text += f", by {np.linalg.norm(one.displacement):.3g} m"
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
