"""Triangles of near objects: what two maps have in common without knowing how they lie.

A motion keeps the lengths of a triangle's sides. An object that both maps have is the corner of
many triangles with neighbors that both have, and these agree about the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.places.alignment.rigid import MotionModel

# Sides of a triangle that are shorter than this many sigmas determine no direction.
_SHORTEST_SIDE = 4.0


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles of a map."""

    corners: Ints
    """Rows of the objects, the first is the anchor, shape (t, 3)."""
    sides: Floats
    """What a motion keeps: lengths in meters, or logarithms of their ratios; shape (t, 2 or 3)."""
    per_meter: Floats
    """How much the largest change of sides is by a meter of one of them, shape (t,)."""
    code: Ints
    """The same for the same classes in the same order, shape (t,)."""

    def __len__(self) -> int:
        """Return the number of triangles."""
        return len(self.code)


def find_triangles(
    centers: Floats,
    labels: Ints,
    *,
    anchors: Ints,
    neighbors: int,
    model: MotionModel,
    shortest: float,
    both_orders: bool,
) -> Triangles:
    """Return the triangles of anchors with two of their nearest neighbors.

    Upright, corners are counterclockwise. In space there is no such order, and one of the maps has
    each triangle in ``both_orders``. Sides are at least as long as the shortest one.
    """
    from scipy.spatial import cKDTree

    places = centers[:, : model.axes]
    nearest = cKDTree(places).query(places[anchors], k=min(neighbors + 1, len(places)))[1]
    first, second = np.triu_indices(nearest.shape[1] - 1, 1)
    anchor = np.repeat(nearest[:, :1], len(first), axis=1).ravel()
    corners = np.column_stack(
        [anchor, nearest[:, 1 + first].ravel(), nearest[:, 1 + second].ravel()]
    )
    corners = corners[(corners[:, 0] != corners[:, 1]) & (corners[:, 0] != corners[:, 2])]
    if model.upright:
        a, b = (places[corners[:, i]] - places[corners[:, 0]] for i in (1, 2))
        clockwise = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] < 0.0
        corners[clockwise] = corners[clockwise][:, [0, 2, 1]]
    elif both_orders:
        corners = np.concatenate([corners, corners[:, [0, 2, 1]]])
    sides = np.column_stack(
        [
            np.linalg.norm(places[corners[:, i]] - places[corners[:, j]], axis=1)
            for i, j in ((0, 1), (0, 2), (1, 2))
        ]
    )
    long = sides.min(axis=1) > shortest
    corners, sides = corners[long], sides[long]
    count = int(labels.max(initial=0)) + 1
    code = labels[corners] @ np.array([count * count, count, 1])
    per_meter = np.ones(len(code))
    if model.has_scale:
        per_meter = 1.0 / sides.min(axis=1)
        sides = np.log(sides[:, 1:] / sides[:, :1])
    return Triangles(corners, sides, per_meter, code)


def match_triangles(a: Triangles, b: Triangles, tolerance: float, most: int) -> tuple[Ints, Ints]:
    """Return rows of triangles of A and of B whose classes agree, and sides do to a tolerance.

    There are about ``most`` at most: then those of an evenly spread part of A's triangles.
    """
    width = 2.0 * tolerance
    cells_b = np.floor(b.sides / width).astype(np.int64)
    low = cells_b.min(axis=0, initial=0) - 1
    extent = cells_b.max(axis=0, initial=0) + 2 - low
    keys_b = _keys(cells_b - low, b.code, extent)
    order = np.argsort(keys_b, kind="stable")
    keys_b = keys_b[order]
    base = np.floor(a.sides / width - 0.5).astype(np.int64) - low
    rows, starts, counts = [], [], []
    for corner in np.ndindex(*(2,) * a.sides.shape[1]):
        cells = base + np.array(corner)
        inside = np.flatnonzero(((cells >= 0) & (cells < extent)).all(axis=1))
        keys = _keys(cells[inside], a.code[inside], extent)
        begin = np.searchsorted(keys_b, keys, "left")
        count = np.searchsorted(keys_b, keys, "right") - begin
        met = count > 0
        rows.append(inside[met])
        starts.append(begin[met])
        counts.append(count[met])
    row, start, count = (np.concatenate(x) for x in (rows, starts, counts))
    stride = int(np.ceil(count.sum() / most)) if most else 1
    if stride > 1:
        kept = (row * 7919) % stride == 0  # an anchor has its triangles in sequence
        row, start, count = row[kept], start[kept], count[kept]
    found_a = np.repeat(row, count)
    offset = np.arange(len(found_a)) - np.repeat(np.cumsum(count) - count, count)
    found_b = order[np.repeat(start, count) + offset]
    near = (np.abs(a.sides[found_a] - b.sides[found_b]) < tolerance).all(axis=1)
    return found_a[near], found_b[near]


def _keys(cells: Ints, code: Ints, extent: Ints) -> Ints:
    key = code
    for axis in range(cells.shape[1]):
        key = key * extent[axis] + cells[:, axis]
    return np.asarray(key)
