"""What arrives at one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike


class StepError(ValueError):
    """A step was refused and changed nothing; the session goes on with the next."""


@dataclass(frozen=True, eq=False)
class Motion:
    """From the pose before to this one, as odometry measured it."""

    relative: ArrayLike
    """next_in_previous, shape (d,)."""
    covariance: ArrayLike
    """In the tangent at ``relative``, translation [m] first, then rotation [rad]; (k, k)."""


@dataclass(frozen=True, eq=False)
class StepBoxes:
    """Boxes of one image."""

    box: ArrayLike
    """[u_min, v_min, u_max, v_max] in undistorted pixels, shape (b, 4)."""
    object_id: ArrayLike
    """Which object each shows, -1 where that is unknown; shape (b,)."""
    class_name: Sequence[str] = ()
    """Of each box; "object" by default."""
    truncated: ArrayLike | None = None
    """Which edges are the border of the image, which the object leaves; (b, 4), none by default."""


@dataclass(frozen=True, eq=False)
class StepPositions:
    """Measured centers of objects that boxes have shown, as a depth camera gives them."""

    object_id: ArrayLike
    """Shape (p,)."""
    object_in_robot: ArrayLike
    """Meters, shape (p, 3)."""
    covariance: ArrayLike
    """Square meters, shape (p, 3, 3)."""


@dataclass(frozen=True, eq=False)
class StepMeasurements:
    """Other measurements of objects that boxes have shown, of one kind of the core."""

    kind: str
    """"range", or another kind with m numbers each."""
    object_id: ArrayLike
    """Shape (p,)."""
    value: ArrayLike
    """Shape (p, m)."""
    covariance: ArrayLike
    """Shape (p, m, m)."""


@dataclass(frozen=True, eq=False)
class Step:
    """All that arrives at one time."""

    timestamp: float
    """Seconds."""
    odometry: Motion | None
    """None for the first step only."""
    boxes: StepBoxes | None = None
    positions: StepPositions | None = None
    measurements: Sequence[StepMeasurements] = ()
