"""The mesh of an object, as a scene has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dqslam._checks import Floats, Ints

Colors = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """The surface of an object, in the frame of its ellipsoid, so that it moves with it."""

    vertices: Floats
    """Meters, shape (v, 3)."""
    triangles: Ints
    """Rows of vertices, shape (f, 3), counter-clockwise from outside."""
    colors: Colors
    """Red, green and blue of each vertex, 0 to 255, shape (v, 3)."""
