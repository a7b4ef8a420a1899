"""The boxes of cuboids that stand upright.

A cuboid stands on its foot, the middle of its lower face, and is turned about the vertical by its
heading, along which its length is.
"""

from __future__ import annotations

from dataclasses import dataclass

from dqslam import _core
from dqslam._checks import Bools, Floats


@dataclass(frozen=True, eq=False)
class Views:
    """The cameras that see a cuboid, one for each box, in a frame whose third axis is up."""

    camera: _core.Camera
    rotation: Floats
    """Of the axes of each camera in the frame, shape (n, 3, 3)."""
    position: Floats
    """Meters, shape (n, 3)."""

    def select(self, rows: Bools) -> Views:
        """Return some of the views, by a flag for each (n,)."""
        return Views(self.camera, self.rotation[rows], self.position[rows])

    @property
    def axes(self) -> Floats:
        """The rotations one below the other, shape (3 n, 3)."""
        return self.rotation.reshape(-1, 3)


def predict_boxes(views: Views, foot: Floats, heading: Floats, half_sides: Floats) -> Floats:
    """Return the boxes (n, 4) of a cuboid at feet (n, 3) and headings (n,), half its sides (3,).

    Pixels, of the corners in front of the camera; NaN where none is.
    """
    return _core.boxes_of_upright_cuboids(
        views.camera, views.axes, views.position, foot, heading, half_sides
    )
