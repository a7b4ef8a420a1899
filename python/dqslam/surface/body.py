"""The bodies of a map around which surfaces are fused, each in its own frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats
from dqslam._core import Shape
from dqslam.io import MapObjects


@dataclass(frozen=True, eq=False)
class Body:
    """The ellipsoid of an object; of a box or a can, that of the same second moments."""

    center: Floats
    """In the world, meters, shape (3,)."""
    world_from_object: Floats
    """Rotation matrix (3, 3); columns are the axes of the object."""
    semi_axes: Floats
    """Meters, shape (3,)."""
    reach: Floats
    """How far the ellipsoid, box or can itself reaches along the axes, meters, shape (3,)."""

    @property
    def size(self) -> float:
        """The radius of the sphere of the same volume, meters."""
        return float(np.cbrt(self.semi_axes.prod()))

    def support(self, normal_in_object: Floats) -> float:
        """Return how far the body reaches from its center along a unit vector (3,), meters."""
        return float(np.linalg.norm(self.semi_axes * normal_in_object))

    def radius(self, points_in_object: Floats) -> Floats:
        """Return the distances of points (..., 3) as multiples of the body: 1 on its surface."""
        return np.asarray(np.linalg.norm(points_in_object / self.semi_axes, axis=-1))

    def to_object(self, points_in_world: Floats) -> Floats:
        """Return points (..., 3) of the world in the frame of the object."""
        return np.asarray((points_in_world - self.center) @ self.world_from_object)

    def to_world(self, points_in_object: Floats) -> Floats:
        """Return points (..., 3) of the object in the world."""
        return np.asarray(points_in_object @ self.world_from_object.T + self.center)


def bodies_of(objects: MapObjects) -> dict[int, Body]:
    """Return the bodies of the ellipsoids, boxes and cans of a map, by their rows."""
    from scipy.spatial.transform import Rotation

    solids, found = objects.solids, {}
    for row in np.flatnonzero(objects.is_ellipsoid).tolist():
        turn = Rotation.from_quat(objects.orientations[row]).as_matrix()
        reach = objects.semi_axes[row]
        if solids.is_body[row]:
            reach = _reach(turn.T @ solids.factors[row], solids.shapes[row])
        found[row] = Body(objects.centers[row], turn, objects.semi_axes[row], reach)
    return found


def _reach(factor: Floats, shape: Shape) -> Floats:
    """Return how far a box or a can with half-axes (3, 3), in columns, reaches along x, y and z."""
    if shape == Shape.CYLINDER:  # its third half-axis is that of the can
        return np.asarray(np.hypot(factor[:, 0], factor[:, 1]) + np.abs(factor[:, 2]))
    return np.asarray(np.abs(factor).sum(axis=1))
