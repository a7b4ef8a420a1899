"""The truth of a recording as CSV: the places of its objects, and the object that each box shows.

Objects have one row each. Columns are found by name, in any order, and others are ignored; # starts
a comment line:

``object_id`` (or ``track_id``, ``id``)
    Whole number, optional.
``class_name`` (or ``class``)
    Optional.
``x y z`` (or ``tx ty tz``, ``cx cy cz``)
    Center in the world, meters.
``qx qy qz qw``, or ``yaw``
    world_from_object, optional; ``yaw`` [rad] turns about the z axis of the world.
``sx sy sz`` (or ``size_x size_y size_z``)
    Full sizes along the object's own axes, meters, optional.
``length height width``
    KITTI's sizes instead of these, along x, y (down) and z; ``yaw`` then turns about the y axis.
``static``
    0 for an object that moves, optional.

Boxes have the columns ``timestamp x1 y1 x2 y2`` of a detection file, and one of object ids.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam._limits import LARGEST_ANGLE_RAD
from dqslam.io.csv_table import CsvTable, read_csv
from dqslam.io.files import FileError
from dqslam.lens import undistort_boxes

IDS = ("object_id", "track_id", "id")
CLASSES = ("class_name", "class")
CENTERS = (("x", "y", "z"), ("tx", "ty", "tz"), ("cx", "cy", "cz"))
QUATERNION = ("qx", "qy", "qz", "qw")
KITTI_SIZES = ("length", "height", "width")
SIZES = (("sx", "sy", "sz"), ("size_x", "size_y", "size_z"), KITTI_SIZES)
EDGES = ("x1", "y1", "x2", "y2")
# Files round quaternions; a larger error of the norm is a mistake.
NORM_TOLERANCE = 1e-3


@dataclass(frozen=True, eq=False)
class TrueObjects:
    """The true objects; None for values that are not in the file."""

    path: str
    id: Ints | None
    """Shape (t,)."""
    class_name: tuple[str, ...] | None
    """One per object."""
    center: Floats
    """In the world, meters, shape (t, 3)."""
    rotation: Floats | None
    """world_from_object, shape (t, 3, 3)."""
    size: Floats | None
    """Full sizes along the object's own axes, meters, shape (t, 3)."""
    static: Bools
    """Whether it stands still, shape (t,); all do if the file has no such column."""

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.center)


@dataclass(frozen=True, eq=False)
class TrueBoxes:
    """Boxes of known objects."""

    path: str
    timestamp: Floats
    """Seconds, shape (t,)."""
    box: Floats
    """[u_min, v_min, u_max, v_max] in undistorted pixels, shape (t, 4)."""
    object_id: Ints
    """The object that it shows, -1 if unknown; shape (t,)."""


def read_true_objects(path: str | Path) -> TrueObjects:
    """Read the true objects of a recording."""
    table = read_csv(path)
    centers = _first(table, CENTERS)
    if centers is None:
        message = f"no columns x, y, z (it has: {', '.join(table.columns)})"
        raise FileError(path, message)
    ids = _first(table, [(name,) for name in IDS])
    classes = _first(table, [(name,) for name in CLASSES])
    object_id = None if ids is None else table.integers(ids[0])
    if object_id is not None:
        first = np.unique(object_id, return_index=True)[1]
        again = ~np.isin(np.arange(len(table)), first)
        table.reject(again, "object {} occurs twice", ids[0] if ids else None)
    return TrueObjects(
        path=str(path),
        id=object_id,
        class_name=None if classes is None else table.cells(classes[0]),
        center=_columns(table, centers),
        rotation=_rotations(table),
        size=_sizes(table),
        static=table.flags("static") if "static" in table else np.ones(len(table), dtype=np.bool_),
    )


def read_true_boxes(
    path: str | Path, camera: _core.Camera, id_column: str = "track_id"
) -> TrueBoxes:
    """Read the boxes of known objects, and undistort them; an empty id means unknown, -1."""
    table = read_csv(path, required=("timestamp", *EDGES, id_column))
    box = _columns(table, EDGES)
    table.reject(np.any(box[:, 2:] <= box[:, :2], axis=1), "empty box: x1 < x2, y1 < y2")
    try:
        box = undistort_boxes(camera, box)
    except ValueError as error:
        raise FileError(path, str(error)) from None
    return TrueBoxes(
        path=str(path),
        timestamp=table.numbers("timestamp"),
        box=box,
        object_id=table.integers(id_column, empty="-1"),
    )


def _first(table: CsvTable, choices: Sequence[tuple[str, ...]]) -> tuple[str, ...] | None:
    """Return the first of the choices whose columns the table has."""
    return next((names for names in choices if all(name in table for name in names)), None)


def _columns(table: CsvTable, names: Sequence[str]) -> Floats:
    return np.column_stack([table.numbers(name) for name in names])


def _sizes(table: CsvTable) -> Floats | None:
    names = _first(table, SIZES)
    if names is None:
        return None
    size = _columns(table, names)
    table.reject(np.any(size <= 0.0, axis=1), f"{' '.join(names)}: a size is not positive")
    return size


def _rotations(table: CsvTable) -> Floats | None:
    from scipy.spatial.transform import Rotation

    if all(name in table for name in QUATERNION):
        xyzw = _columns(table, QUATERNION)
        off = np.abs(np.linalg.norm(xyzw, axis=1) - 1.0) > NORM_TOLERANCE
        table.reject(off, "the quaternion is not of length 1")
        return np.asarray(Rotation.from_quat(xyzw).as_matrix())
    if "yaw" not in table:
        return None
    axis = [0.0, 1.0, 0.0] if _first(table, SIZES) == KITTI_SIZES else [0.0, 0.0, 1.0]
    yaw = table.numbers("yaw")
    table.reject(np.abs(yaw) > LARGEST_ANGLE_RAD, "yaw {} is no angle in radians", "yaw")
    return np.asarray(Rotation.from_rotvec(np.outer(yaw, axis)).as_matrix())
