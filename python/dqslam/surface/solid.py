"""The closed solid of an object in its volume, and how much of its surface was seen.

Space that no image saw as free counts as the object's where it is in the convex hull of what was
seen of the object, or in the body of the map. Only the part that was seen is measured.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dqslam._checks import Bools, Floats, Ints
from dqslam.surface.body import Body
from dqslam.surface.planes import Plane
from dqslam.surface.volume import Volume

Array = NDArray[np.float32]
# A plane is cut off so many voxels, and so many times its roughness, before it: its own noise
# must not connect things that stand on it.
_CLEARANCE_VOXELS, _CLEARANCE_SIGMAS = 1.5, 3.0
_DIRECTIONS = 600  # in which the corners of a convex hull are looked for


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed surface of triangles in the frame of an object."""

    vertices: Floats
    """Meters, shape (v, 3)."""
    faces: Ints
    """Rows of vertices, counter-clockwise from outside, shape (f, 3)."""
    seen: Bools
    """Whether images saw each face, shape (f,)."""
    supported: Bools
    """Whether each face lies on a plane behind or below the object, shape (f,)."""

    @property
    def areas(self) -> Floats:
        """Areas of the faces, square meters, shape (f,)."""
        return np.asarray(0.5 * np.linalg.norm(self._crosses(), axis=1))

    @property
    def volume(self) -> float:
        """Cubic meters, by the divergence theorem."""
        return float((self.vertices[self.faces[:, 0]] * self._crosses()).sum() / 6.0)

    @property
    def center(self) -> Floats:
        """The center of gravity, meters, shape (3,)."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        parts = (a * self._crosses()).sum(axis=1) / 6.0  # signed, of tetrahedra to the origin
        # Of a closed surface, tetrahedra to any point give the same; this one is near.
        return np.asarray((parts @ ((a + b + c) / 4.0)) / parts.sum())

    @property
    def seen_share(self) -> float:
        """The share of the surface, apart from where it stands, that images saw."""
        areas = self.areas
        free = areas[~self.supported].sum()
        return float(areas[self.seen & ~self.supported].sum() / free) if free > 0.0 else 0.0

    def _crosses(self) -> Floats:
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return np.asarray(np.cross(b - a, c - a))

    def part(self, keep: Bools) -> tuple[Floats, Ints]:
        """Return some of the faces (f,), with the vertices that they need."""
        faces = self.faces[keep]
        used, numbers = np.unique(faces, return_inverse=True)
        return self.vertices[used], numbers.reshape(-1, 3)


def solid_of(volume: Volume, planes: Sequence[Plane], others: Sequence[Body]) -> Solid | None:
    """Return the solid of the object in a volume; None if nothing of it was seen.

    Parameters
    ----------
    planes
        Planes behind or below the object, which are not of it.
    others
        The bodies of other objects: what is nearer to these is theirs, by their own measure.
    """
    from scipy import ndimage

    points = _grid_points(volume)
    radius = volume.body.radius(points)
    foreign = np.zeros(volume.shape, dtype=np.bool_)
    for other in others:
        foreign |= other.radius(other.to_object(volume.body.to_world(points))) < radius
    heights = [plane.height(points) for plane in planes]
    clearances = [
        _CLEARANCE_VOXELS * volume.voxel + _CLEARANCE_SIGMAS * plane.roughness for plane in planes
    ]
    for height, clearance in zip(heights, clearances, strict=True):
        foreign |= height < clearance
    seen, distance = volume.is_seen, volume.distance
    behind = seen & (distance < 0.0) & ~foreign
    labels, count = ndimage.label(behind | (~seen & ~foreign & (radius <= 1.0)))
    if count == 0:
        return None
    # The part whose seen surface is largest within the body.
    votes = np.bincount(labels[behind & (radius <= 1.5)], minlength=count + 1)[1:]
    if not votes.any():
        return None
    mine = labels == 1 + int(np.argmax(votes))
    inside = mine | _in_hull(points, mine & behind, ~seen & ~foreign)
    near = ndimage.binary_dilation(inside, iterations=2)
    field = np.where(seen & near & ~(behind & ~mine), distance, np.float32(1.0))
    field[inside & ~seen] = -1.0
    field[foreign] = 1.0
    measured = seen & ~foreign
    for plane, height, clearance in zip(planes, heights, clearances, strict=True):
        field, measured = _down_to(plane, height, clearance, field, measured, volume)
    return _meshed(field, measured, planes, volume)


def _grid_points(volume: Volume) -> Floats:
    """Return the centers of all voxels in the frame of the object, shape (i, j, k, 3)."""
    axes = [
        origin + volume.voxel * np.arange(count)
        for origin, count in zip(volume.origin, volume.shape, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def _in_hull(points: Floats, surface: Bools, candidates: Bools) -> Bools:
    """Return which candidates (i, j, k) are in the convex hull of the voxels of a surface."""
    from scipy.spatial import Delaunay, QhullError

    found = np.zeros(surface.shape, dtype=np.bool_)
    corners = _extremes(points[surface])
    low, high = corners.min(axis=0), corners.max(axis=0)
    rows = np.flatnonzero(candidates & (points >= low).all(axis=-1) & (points <= high).all(axis=-1))
    with contextlib.suppress(QhullError):  # fewer than four, or all in a plane: no hull
        simplex = Delaunay(corners).find_simplex(points.reshape(-1, 3)[rows])
        found.reshape(-1)[rows[simplex >= 0]] = True
    return found


def _extremes(points: Floats) -> Floats:
    """Return the furthest of points (p, 3) in directions all around, (c, 3), c <= p."""
    place = np.arange(_DIRECTIONS) + 0.5  # on a spiral over the sphere
    z, turn = 1.0 - 2.0 * place / _DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * place
    level = np.sqrt(1.0 - z * z)
    directions = np.column_stack([level * np.cos(turn), level * np.sin(turn), z])
    return np.asarray(points[np.unique([int(np.argmax(points @ one)) for one in directions])])


def _down_to(
    plane: Plane,
    height: Floats,
    clearance: float,
    field: Array,
    measured: Bools,
    volume: Volume,
) -> tuple[Array, Bools]:
    """Continue a solid from the clearance down to its plane, where it ends."""
    from scipy import ndimage

    step = plane.normal / volume.voxel
    slab = np.argwhere((height >= -volume.voxel) & (height < clearance))
    lift = clearance + 0.5 * volume.voxel - height[tuple(slab.T)]
    places = (slab + lift[:, None] * step).T
    above = ndimage.map_coordinates(field, places, order=1, mode="nearest")
    ground = -height[tuple(slab.T)] / volume.truncation
    field, measured = field.copy(), measured.copy()
    field[tuple(slab.T)] = np.maximum(above, ground)
    measured[tuple(slab.T)] = (
        ndimage.map_coordinates(measured.astype(np.float32), places, order=0, mode="nearest") > 0.5
    )
    return field, measured


def _meshed(field: Array, measured: Bools, planes: Sequence[Plane], volume: Volume) -> Solid | None:
    from skimage.measure import marching_cubes

    padded = np.pad(field, 1, constant_values=1.0)
    if not (padded < 0.0).any():
        return None
    vertices, faces, _, _ = marching_cubes(padded, 0.0, gradient_direction="descent")
    index = vertices.astype(float) - 1.0
    points = volume.points(index)
    known = np.ones(len(points), dtype=np.bool_)
    for side in (np.floor(index), np.ceil(index)):
        last = np.array(volume.shape) - 1
        place = np.clip(side, 0, last).astype(int)
        known &= measured[tuple(place.T)] & (side == place).all(axis=1)
    supported = np.zeros(len(faces), dtype=np.bool_)
    for plane in planes:
        supported |= (np.abs(plane.height(points)) < 0.6 * volume.voxel)[faces].all(axis=1)
    return Solid(
        vertices=points,
        faces=faces.astype(np.int64),
        seen=np.asarray(known[faces].all(axis=1) & ~supported),
        supported=supported,
    )
