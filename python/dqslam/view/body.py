"""Cuboids and cylinders as viewers draw them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dqslam._checks import Floats
from dqslam._core import Shape
from dqslam.solids import Mesh, Solids, hull_points, mesh, wireframe


@dataclass(frozen=True, eq=False)
class Body:
    """A cuboid or a cylinder."""

    shape: Literal["cuboid", "cylinder"]
    half_lengths: Floats
    """Meters, shape (3,); the third of a cylinder is along its axis."""
    orientation_xyzw: Floats
    """world_from_body, shape (4,)."""
    hull: Floats
    """Points that it is the hull of, meters, shape (k, 3)."""
    lines: tuple[Floats, ...]
    """Its edges, as lines through points of shape (k, 3), meters."""
    mesh: Mesh
    """Its surface."""


def body_of(solids: Solids, row: int) -> Body | None:
    """Return a solid as a body; None if it is an ellipsoid or has no surface."""
    from scipy.spatial.transform import Rotation

    if not solids.is_body[row]:
        return None
    factor, shape = solids.factors[row], solids.shapes[row]
    half_lengths = np.linalg.norm(factor, axis=0)
    return Body(
        shape="cuboid" if shape == Shape.CUBOID else "cylinder",
        half_lengths=half_lengths,
        orientation_xyzw=Rotation.from_matrix(factor / half_lengths).as_quat(),
        hull=solids.centers[row] + hull_points(shape) @ factor.T,
        lines=tuple(wireframe(solids, row)),
        mesh=mesh(solids, row),
    )
