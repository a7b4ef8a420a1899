"""Planes on which an object stands or before which it hangs: the floor, a table, a wall.

They are found in what was fused around the object. The center of the object is on the free side of
such a plane, which no face of a convex object can say of itself, and most of what is seen of the
plane is outside of the object's body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.surface.body import Body
from dqslam.surface.volume import Volume

_MOST = 4  # a floor and three walls
_TRIALS = 300
# The plane must be at least this share of the body's reach before its center, and pass through or
# near the body: beyond this multiple of the reach, it does not touch the object.
_NEAREST, _FURTHEST = 0.25, 1.6
# The least part of the seen surface that lies in a plane, and of that the part outside the body.
_LEAST_SHARE, _LEAST_OUTSIDE = 0.05, 0.6
_COSINE = np.cos(np.radians(25.0))  # of the angle between a normal and that of its plane
_MOST_POINTS = 20_000


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane in the frame of an object, whose center is on its free side."""

    normal: Floats
    """Unit vector into free space, shape (3,)."""
    offset: float
    """Its height along the normal above the center of the object, meters; negative."""
    roughness: float
    """Root mean square distance of its points, meters."""

    def height(self, points_in_object: Floats) -> Floats:
        """Return how far points (..., 3) are before the plane, meters."""
        return np.asarray(points_in_object @ self.normal - self.offset)


def surface_points(volume: Volume) -> tuple[Floats, Floats]:
    """Return points (p, 3) of what was fused, in the frame of the object, and unit normals (p, 3).

    A point lies between two neighboring voxels that were seen, one before and one behind a surface.
    """
    distance, seen = volume.distance, volume.is_seen
    slopes = np.gradient(distance)
    points, normals = [], []
    for axis in range(3):
        low, high = [slice(None)] * 3, [slice(None)] * 3
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        a, b = np.asarray(distance[tuple(low)]), np.asarray(distance[tuple(high)])
        crosses = seen[tuple(low)] & seen[tuple(high)] & ((a < 0.0) != (b < 0.0))
        crosses &= np.abs(a - b) < 1.0  # not from one free side to the back of the other
        index = np.argwhere(crosses)
        place = index.astype(float)
        place[:, axis] += np.asarray(a / (a - b + (a == b)))[crosses]
        points.append(volume.points(place))
        normals.append(np.stack([np.asarray(one)[tuple(index.T)] for one in slopes], axis=1))
    normal = np.concatenate(normals).astype(float)
    length = np.linalg.norm(normal, axis=1)
    keep = length > 0.0
    return np.concatenate(points)[keep], normal[keep] / length[keep, None]


def background_planes(points: Floats, normals: Floats, body: Body, voxel: float) -> list[Plane]:
    """Find the planes behind or below an object, the largest first.

    Parameters
    ----------
    points, normals
        Points (p, 3) of seen surfaces, in the frame of the object, and their unit normals (p, 3).
    voxel
        Meters: points so near to a plane are of it.
    """
    rng = np.random.default_rng(0)
    if len(points) > _MOST_POINTS:
        chosen = rng.choice(len(points), _MOST_POINTS, replace=False)
        points, normals = points[chosen], normals[chosen]
    total, outside = len(points), body.radius(points) > 1.0
    found: list[Plane] = []
    left = np.ones(total, dtype=np.bool_)
    while len(found) < _MOST:
        plane = _largest(points, normals, left & outside, body, voxel, rng)
        if plane is None:
            break
        mine = left & _belongs(points, normals, plane, 2.0 * voxel)
        if mine.sum() < _LEAST_SHARE * total:
            break
        left &= ~mine
        if outside[mine].mean() >= _LEAST_OUTSIDE and not _is_known(plane, found):
            found.append(plane)
    return found


def _largest(
    points: Floats,
    normals: Floats,
    candidates: Bools,
    body: Body,
    voxel: float,
    rng: np.random.Generator,
) -> Plane | None:
    """Return the plane before the center with most of the candidates, fitted to them."""
    rows = np.flatnonzero(candidates)
    if rows.size < 3:
        return None
    best: Plane | None = None
    most = 0
    for seed in rng.choice(rows, _TRIALS):
        normal = normals[seed]
        offset = float(points[seed] @ normal)
        if not _NEAREST < -offset / body.support(normal) < _FURTHEST:
            continue
        plane = Plane(normal, offset, 0.0)
        count = int(_belongs(points[rows], normals[rows], plane, voxel).sum())
        if count > most:
            best, most = plane, count
    if best is None:
        return None
    for _ in range(3):
        mine = rows[_belongs(points[rows], normals[rows], best, voxel)]
        if mine.size < 3:
            return None
        best = _fitted(points[mine], best.normal)
    inside = _NEAREST < -best.offset / body.support(best.normal) < _FURTHEST
    return best if inside else None


def _fitted(points: Floats, normal: Floats) -> Plane:
    """Return the plane nearest to points (p, 3), on the same side as a normal."""
    middle = points.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov((points - middle).T))
    fitted = vectors[:, 0] * np.sign(vectors[:, 0] @ normal)
    return Plane(fitted, float(middle @ fitted), float(np.sqrt(max(values[0], 0.0))))


def _belongs(points: Floats, normals: Floats, plane: Plane, tolerance: float) -> Bools:
    near = np.abs(plane.height(points)) < tolerance
    return np.asarray(near & (normals @ plane.normal > _COSINE))


def _is_known(plane: Plane, found: list[Plane]) -> bool:
    """Return whether a plane is a second layer of another."""
    return any(plane.normal @ other.normal > _COSINE for other in found)
