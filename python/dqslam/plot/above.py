"""The view from above of any world, with the longer side of the path across the figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dqslam._checks import Floats
from dqslam.metrics import up_direction
from dqslam.solids import Solids, flat_outline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CIRCLE = np.stack([f(np.linspace(0.0, 2.0 * np.pi, 73)) for f in (np.cos, np.sin)])
_NAMES = ("x", "y", "z")


@dataclass(frozen=True, eq=False)
class FromAbove:
    """A projection along the vertical."""

    axes: Floats
    """Directions in the world that point right and up in the figure, shape (2, 3)."""
    labels: tuple[str, str]
    """Labels of the horizontal and the vertical axis of the figure."""
    downward: bool
    """Whether the figure's vertical axis must be inverted to have the numbers of the world."""

    def set_up(self, axes: Axes) -> None:
        """Label the axes of a map in this view, with one scale for both and a faint grid."""
        axes.set(aspect="equal", xlabel=self.labels[0], ylabel=self.labels[1])
        axes.grid(alpha=0.25, linewidth=0.4)
        if self.downward:
            axes.invert_yaxis()

    def points(self, points: Floats) -> Floats:
        """Return the places (n, 2) of points (n, 3) in the figure, meters."""
        return np.asarray(points @ self.axes.T)

    def solid_outlines(self, solids: Solids) -> list[Floats]:
        """Return the outline (2, n) of each solid, or its center (2, 1) if it has no surface."""
        found = []
        for row, has_surface in enumerate(solids.has_surface):
            factor = solids.factors[row]
            if not has_surface:
                found.append(self.points(solids.centers[[row]]).T)
            elif solids.is_body[row]:
                found.append(flat_outline(solids, row, self.axes))
            else:
                found.append(self.outline(solids.centers[row], factor @ factor.T))
        return found

    def outline(self, center: Floats, shape: Floats) -> Floats:
        """Return the outline (2, n) of an ellipsoid with center (3,) [m], shape (3, 3) [m^2]."""
        return outline(self.axes @ center, self.axes @ shape @ self.axes.T)


def outline(center: Floats, shape: Floats) -> Floats:
    """Return the outline (2, n) of an ellipse with a center (2,) and a shape (2, 2).

    The shape may be singular.
    """
    squares, along = np.linalg.eigh(shape)
    return np.asarray(center[:, None] + along * np.sqrt(squares.clip(min=0.0)) @ CIRCLE)


def from_above(world_from_camera: Floats) -> FromAbove:
    """Choose the view of a path (n, 7).

    If an axis of the world is vertical, the axes of the figure are the other two. Without
    poses, z is vertical.
    """
    if not len(world_from_camera):
        return FromAbove(np.eye(3)[:2], ("x [m]", "y [m]"), downward=False)
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
    if turned:  # rotates the view by a quarter turn to the right
        axes, labels = axes[::-1].copy(), (labels[1], labels[0])
    return FromAbove(axes, (f"{labels[0]} [m]", f"{labels[1]} [m]"), downward=turned)
