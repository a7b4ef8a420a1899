"""The view from above: any world on paper, with its longer side across."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats
from dqslam.metrics import up_direction

CIRCLE = np.stack([f(np.linspace(0.0, 2.0 * np.pi, 73)) for f in (np.cos, np.sin)])
_NAMES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class FromAbove:
    """A projection along the vertical."""

    axes: Floats
    """The directions in the world that point to the right and up on the paper, shape (2, 3)."""
    labels: tuple[str, str]
    """Labels of both axes."""
    downward: bool
    """Whether the second axis runs down the paper, so that its numbers are those of the world."""

    def points(self, points: Floats) -> Floats:
        """Return the places (n, 2) of points (n, 3) on the paper."""
        return np.asarray(points @ self.axes.T)

    def outline(self, center: Floats, shape: Floats) -> Floats:
        """Return the outline from above, (2, n), of an ellipsoid of a shape [m^2], (3, 3)."""
        return outline(self.axes @ center, self.axes @ shape @ self.axes.T)


def outline(center: Floats, shape: Floats) -> Floats:
    """Return the outline (2, n) of an ellipse of center (2,) and shape (2, 2), perhaps flat."""
    squares, along = np.linalg.eigh(shape)
    return np.asarray(center[:, None] + along * np.sqrt(squares.clip(min=0.0)) @ CIRCLE)


def from_above(world_from_camera: Floats) -> FromAbove:
    """Choose the view of a path (n, 7), with an axis of the world across if one is vertical."""
    up = up_direction(world_from_camera)
    vertical = int(np.argmax(np.abs(up)))
    if np.abs(up[vertical]) == 1.0:
        first, second = (vertical + 1) % 3, (vertical + 2) % 3
        if up[vertical] < 0.0:
            first, second = second, first
        axes, labels = np.eye(3)[[first, second]], (_NAMES[first], _NAMES[second])
    else:
        across = np.cross(np.eye(3)[np.argmin(np.abs(up))], up)
        across /= np.linalg.norm(across)
        axes, labels = np.stack([across, np.cross(up, across)]), ("across", "along")
    spread = np.ptp(world_from_camera[:, :3] @ axes.T, axis=0)
    turned = bool(spread[1] > spread[0])
    if turned:  # a quarter turn of the paper to the right
        axes, labels = axes[::-1].copy(), (labels[1], labels[0])
    return FromAbove(axes, (f"{labels[0]} [m]", f"{labels[1]} [m]"), downward=turned)
