"""The surface of a solid as triangles, and its edges as lines, in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._core import Shape
from dqslam.solids.solids import Solids, hull_points

_RINGS, _SECTORS = 16, 32
_RULINGS = 4  # lines along the side of a cylinder


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed surface."""

    vertices: Floats
    """Meters, shape (v, 3)."""
    triangles: Ints
    """Rows of vertices, counter-clockwise from outside, shape (f, 3)."""


def mesh(solids: Solids, row: int) -> Mesh:
    """Return the surface of a solid."""
    shape = solids.shapes[row]
    if shape == Shape.ELLIPSOID:
        unit, triangles = unit_sphere()
    elif shape == Shape.CUBOID:
        unit, triangles = hull_points(shape), _hull_triangles(hull_points(shape))
    else:
        unit = hull_points(shape, _SECTORS)
        triangles = _hull_triangles(unit)
    if np.linalg.det(solids.factors[row]) < 0.0:
        triangles = triangles[:, ::-1]
    return Mesh(unit @ solids.factors[row].T + solids.centers[row], triangles)


def wireframe(solids: Solids, row: int) -> list[Floats]:
    """Return the edges of a solid as lines through points (k, 3), meters.

    They are the twelve edges of a cuboid; two rims and four lines along the side of a cylinder; and
    of an ellipsoid the ellipses in its three planes of symmetry.
    """
    shape = solids.shapes[row]
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    circle, zero = np.stack([np.cos(angle), np.sin(angle)]), np.zeros(49)
    if shape == Shape.CUBOID:
        corners = hull_points(shape)
        lines = [
            corners[[first, first | bit]]
            for first in range(8)
            for bit in (1, 2, 4)
            if not first & bit
        ]
    elif shape == Shape.CYLINDER:
        lines = [np.column_stack([*circle, zero + end]) for end in (-1.0, 1.0)]
        for at in 2.0 * np.pi * np.arange(_RULINGS) / _RULINGS:
            lines.append(np.array([[np.cos(at), np.sin(at), end] for end in (-1.0, 1.0)]))
    else:
        lines = [np.roll([*circle, zero], k, axis=0).T for k in range(3)]
    return [line @ solids.factors[row].T + solids.centers[row] for line in lines]


def unit_sphere() -> tuple[Floats, Ints]:
    """Return vertices (v, 3) on the unit sphere and triangles (f, 3), counter-clockwise outside."""
    polar = np.linspace(0.0, np.pi, _RINGS + 1)[1:-1]
    around = 2.0 * np.pi * np.arange(_SECTORS) / _SECTORS
    rings = np.stack(
        [
            np.outer(np.sin(polar), np.cos(around)),
            np.outer(np.sin(polar), np.sin(around)),
            np.outer(np.cos(polar), np.ones(_SECTORS)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.vstack([[[0.0, 0.0, 1.0]], rings, [[0.0, 0.0, -1.0]]])
    last = len(vertices) - 1
    here = np.arange(_SECTORS)
    beside = np.roll(here, -1)
    faces = [np.column_stack([np.zeros_like(here), 1 + here, 1 + beside])]
    for ring in range(_RINGS - 2):
        upper, lower = 1 + ring * _SECTORS, 1 + (ring + 1) * _SECTORS
        faces.append(np.column_stack([upper + here, lower + here, lower + beside]))
        faces.append(np.column_stack([upper + here, lower + beside, upper + beside]))
    final = 1 + (_RINGS - 2) * _SECTORS
    faces.append(np.column_stack([final + here, np.full_like(here, last), final + beside]))
    return vertices, np.vstack(faces)


def _hull_triangles(points: Floats) -> Ints:
    """Return the triangles of the hull of points (n, 3), counter-clockwise from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    triangles = np.array(hull.simplices, dtype=np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inward = np.einsum("ni,ni->n", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    triangles[inward] = triangles[inward, ::-1]
    return triangles
