"""Something that moves, as plain data: where it was in the images that show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam._repr import counted

Behavior = Literal["rests", "moves", "stops and goes"]
"""What a thing does while it is seen."""


@dataclass(frozen=True, eq=False)
class Track:
    """A thing that moves on the ground, at the images that show it.

    It is a cuboid that stands upright: its first axis is forward, its second to the left, its third
    up. Covariances include what is unknown of the camera's path.
    """

    track_id: int
    class_name: str
    behavior: Behavior
    """"moves", or "stops and goes" if it rests in some of the images."""
    probability: float
    """That it moves at all, given its boxes and what is known of its class."""
    pose: Ints
    """Rows of the poses of its images, ascending, shape (n,)."""
    centers: Floats
    """Middles of the cuboid in the world, meters, shape (n, 3)."""
    orientations: Floats
    """world_from_thing, x y z w, shape (n, 4)."""
    headings: Floats
    """Angles about the direction up, radians, shape (n,); in the plane, from the first axis of the
    world."""
    speeds: Floats
    """Along the heading, meters per second, shape (n,)."""
    turn_rates: Floats
    """Radians per second, shape (n,)."""
    is_moving: Bools
    """Whether it moves, not rests, at each image, shape (n,)."""
    sides: Floats
    """Length, width and height, meters, shape (3,)."""
    center_covariances: Floats
    """Square meters, shape (n, 3, 3)."""
    heading_sigmas: Floats
    """Radians, shape (n,)."""
    speed_sigmas: Floats
    """Meters per second, shape (n,)."""
    turn_rate_sigmas: Floats
    """Radians per second, shape (n,)."""
    log_sides_sigmas: Floats
    """Sigmas of the natural logarithms of the sides, shape (3,)."""

    def __len__(self) -> int:
        """Return the number of images."""
        return len(self.pose)

    def __repr__(self) -> str:
        """Show what it is and does, in how many images."""
        return (
            f"Track({self.track_id}, {self.class_name!r} {self.behavior}, "
            f"{counted(len(self), 'image')}, {np.median(np.abs(self.speeds)):.1f} m/s)"
        )

    def corners(self) -> Floats:
        """Return the corners of the cuboid in the world, meters, shape (n, 8, 3)."""
        from scipy.spatial.transform import Rotation

        signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
        turns = Rotation.from_quat(self.orientations).as_matrix()
        arms = (0.5 * signs * self.sides) @ turns.transpose(0, 2, 1)
        return np.asarray(self.centers[:, None] + arms)
