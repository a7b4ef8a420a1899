"""Solids as plain data.

A solid is ``{c + A u}``, with the center c and A = R diag(half-lengths), whose columns are its
half-axes in the world. u is in the unit ball for an ellipsoid, in the unit cube for a cuboid, and
in the unit cylinder, whose axis is the third, for a cylinder. Edges are sharp; only predicted boxes
have those of the estimator, which are a little rounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import Shape

Rows = NDArray[np.signedinteger[Any]]
#: Volume over the product of the half-lengths.
_VOLUME = {
    Shape.ELLIPSOID: 4.0 / 3.0 * np.pi,
    Shape.CUBOID: 8.0,
    Shape.CYLINDER: 2.0 * np.pi,
}

#: Half-axes of the ellipsoid with the same second moments over those of the solid.
MOMENTS = {
    Shape.ELLIPSOID: np.ones(3),
    Shape.CUBOID: np.sqrt([5.0 / 3.0, 5.0 / 3.0, 5.0 / 3.0]),
    Shape.CYLINDER: np.sqrt([5.0 / 4.0, 5.0 / 4.0, 5.0 / 3.0]),
}
_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


@dataclass(frozen=True, eq=False)
class Solids:
    """Ellipsoids, cuboids and cylinders."""

    shapes: tuple[Shape, ...]
    """One per solid: ELLIPSOID, CUBOID or CYLINDER."""
    centers: Floats
    """Meters, shape (o, 3)."""
    factors: Floats
    """A, meters, shape (o, 3, 3); NaN for an object that has no surface."""
    ellipsoids: Floats
    """Center and log-Cholesky shape, shape (o, 9). An ellipsoid with the same second moments stands
    for a cuboid or a cylinder; NaN for an object that has no surface."""

    def __len__(self) -> int:
        """Return the number of solids."""
        return len(self.shapes)

    @staticmethod
    def of_ellipsoids(ellipsoids: Floats) -> Solids:
        """Return ellipsoids, each center and log-Cholesky shape, shape (o, 9)."""
        factors = np.full((len(ellipsoids), 3, 3), np.nan)
        real = np.isfinite(ellipsoids).all(axis=1)
        squares, axes = np.linalg.eigh(_core.ellipsoid_shapes(ellipsoids[real]))
        squares, axes = squares[:, ::-1], axes[:, :, ::-1].copy()
        axes[:, :, 2] *= np.sign(np.linalg.det(axes))[:, None]  # rotations, not reflections
        factors[real] = axes * np.sqrt(squares)[:, None, :]
        shapes = (Shape.ELLIPSOID,) * len(ellipsoids)
        return Solids(shapes, ellipsoids[:, :3], factors, ellipsoids)

    @staticmethod
    def of_axes(
        shapes: Sequence[Shape], centers: Floats, half_lengths: Floats, rotations: Floats
    ) -> Solids:
        """Return solids by their centers (o, 3), half-lengths (o, 3) and world_from_object.

        ``rotations`` has shape (o, 3, 3).
        """
        factors = rotations * half_lengths[:, None, :]
        ellipsoids = [
            _ellipsoid(center, factor * MOMENTS[shape])
            for shape, center, factor in zip(shapes, centers, factors, strict=True)
        ]
        return Solids(tuple(shapes), centers, factors, np.array(ellipsoids).reshape(-1, 9))

    @property
    def is_body(self) -> Bools:
        """Whether each is a cuboid or a cylinder, shape (o,)."""
        return np.array([shape != Shape.ELLIPSOID for shape in self.shapes], dtype=np.bool_)

    @property
    def has_surface(self) -> Bools:
        """Whether each has a surface, shape (o,)."""
        return np.asarray(np.isfinite(self.factors).all(axis=(1, 2)))

    @property
    def volumes(self) -> Floats:
        """Cubic meters, shape (o,); NaN for an object that has no surface."""
        shares = np.array([_VOLUME[shape] for shape in self.shapes], dtype=np.float64)
        known = np.where(self.has_surface[:, None, None], self.factors, 0.0)
        return np.where(self.has_surface, shares * np.abs(np.linalg.det(known)), np.nan)

    def take(self, rows: Rows | Bools | Sequence[int]) -> Solids:
        """Return the solids of some rows, which may repeat, or of flags (o,)."""
        numbers = np.arange(len(self))[np.asarray(rows) if len(rows) else slice(0)]
        return Solids(
            tuple(self.shapes[row] for row in numbers),
            self.centers[numbers],
            self.factors[numbers],
            self.ellipsoids[numbers],
        )

    def moved(self, rotation: Floats, translation: Floats, scale: float = 1.0) -> Solids:
        """Return the solids moved by x -> scale * rotation @ x + translation."""
        factors = scale * rotation @ self.factors
        centers = scale * self.centers @ rotation.T + translation
        ellipsoids = np.full((len(self), 9), np.nan)
        for row in np.flatnonzero(self.has_surface):
            half_axes = factors[row] * MOMENTS[self.shapes[row]]
            ellipsoids[row] = _ellipsoid(centers[row], half_axes)
        return Solids(self.shapes, centers, factors, ellipsoids)

    def support(self, direction: Floats) -> Floats:
        """Return how far each reaches from its center along a unit vector (3,), meters, (o,)."""
        along = np.abs(direction @ self.factors)
        reach = np.linalg.norm(along, axis=1)
        for row in np.flatnonzero(self.is_body):
            a, b, c = along[row]
            reach[row] = a + b + c if self.shapes[row] == Shape.CUBOID else np.hypot(a, b) + c
        return np.asarray(reach)

    def contains(self, row: int, points: Floats) -> Bools:
        """Return whether points (n, 3) are inside a solid, shape (n,)."""
        u = np.linalg.solve(self.factors[row], (points - self.centers[row]).T).T
        if self.shapes[row] == Shape.CUBOID:
            return np.asarray((np.abs(u) <= 1.0).all(axis=1))
        if self.shapes[row] == Shape.CYLINDER:
            return np.asarray((np.hypot(u[:, 0], u[:, 1]) <= 1.0) & (np.abs(u[:, 2]) <= 1.0))
        return np.asarray(np.linalg.norm(u, axis=1) <= 1.0)

    def filled(self, row: int, uniform: Floats) -> Floats:
        """Return points evenly inside a solid, (n, 3), from points (n, 3) of the cube [0, 1]^3."""
        signed = 2.0 * uniform - 1.0
        if self.shapes[row] == Shape.CUBOID:
            inside = signed
        elif self.shapes[row] == Shape.CYLINDER:
            radius, angle = np.sqrt(uniform[:, 2]), 2.0 * np.pi * uniform[:, 1]
            inside = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), signed[:, 0]])
        else:
            z, angle = signed[:, 0], 2.0 * np.pi * uniform[:, 1]
            across = np.sqrt(1.0 - z**2)
            on_sphere = np.column_stack([across * np.cos(angle), across * np.sin(angle), z])
            inside = on_sphere * np.cbrt(uniform[:, 2])[:, None]
        return np.asarray(inside @ self.factors[row].T + self.centers[row])


def body_solids(
    shapes: Sequence[Shape],
    ellipsoids: Floats,
    centers: Floats,
    half_lengths: Floats,
    rotation_vectors: Floats,
) -> Solids:
    """Return the solids of a map.

    Parameters
    ----------
    shapes
        One per object; empty if all are ellipsoids.
    ellipsoids
        Center and log-Cholesky shape of each object, or of the ellipsoid that stands for it,
        shape (o, 9); NaN for an object that has no surface.
    centers
        Meters, shape (o, 3).
    half_lengths, rotation_vectors
        Half-lengths [m] and world_from_object [rad] of cuboids and cylinders, shape (o, 3) each.
    """
    from scipy.spatial.transform import Rotation

    plain = Solids.of_ellipsoids(ellipsoids)
    if not shapes:
        return Solids(plain.shapes, centers, plain.factors, ellipsoids)
    factors = plain.factors.copy()
    rows = np.flatnonzero([shape != Shape.ELLIPSOID for shape in shapes])
    turns = Rotation.from_rotvec(rotation_vectors[rows]).as_matrix()
    factors[rows] = turns.reshape(-1, 3, 3) * half_lengths[rows, None, :]
    return Solids(tuple(shapes), centers, factors, ellipsoids)


def hull_points(shape: Shape, around_rim: int = 36) -> Floats:
    """Return points u whose hull is the unit cube, (8, 3), or the unit cylinder.

    Each of the two rims of a cylinder has as many points as asked for, ``around_rim`` >= 3.
    """
    if shape == Shape.CUBOID:
        return _CORNERS
    angle = 2.0 * np.pi * np.arange(around_rim) / around_rim
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.vstack([np.column_stack([rim, np.full(around_rim, end)]) for end in (-1.0, 1.0)])


def _ellipsoid(center: Floats, factor: Floats) -> Floats:
    """Return the log-Cholesky parameters (9,) of {c + A u}, u in the unit ball."""
    from scipy.spatial.transform import Rotation

    u, semi_axes, _ = np.linalg.svd(factor)
    u[:, 2] *= np.sign(np.linalg.det(u))
    return np.asarray(
        _core.ellipsoid_from_axes(center, semi_axes, Rotation.from_matrix(u).as_quat())
    )
