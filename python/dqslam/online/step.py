"""The input of one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike


class StepError(ValueError):
    """A step is wrong. The session is unchanged and can continue with the next step."""


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion from the pose before to this one, as odometry measured it."""

    relative: ArrayLike
    """next_in_previous, shape (d,)."""
    covariance: ArrayLike
    """Covariance in the tangent at ``relative``, translation [m], then rotation [rad]; (k, k)."""


@dataclass(frozen=True, eq=False)
class StepBoxes:
    """Boxes of one image."""

    box: ArrayLike
    """[u_min, v_min, u_max, v_max] in undistorted pixels, shape (b, 4)."""
    object_id: ArrayLike
    """Id of the object that each box shows, -1 if unknown; shape (b,)."""
    class_name: Sequence[str] = ()
    """Class of each box; "object" by default."""
    truncated: ArrayLike | None = None
    """Whether each edge is cut by the image border, shape (b, 4); by default none is."""
    embedding: ArrayLike = ()
    """What each box looks like, as a vector whose direction counts, shape (b, e); by default e is
    0. All boxes of a session have vectors of one length, or none has."""


@dataclass(frozen=True, eq=False)
class StepPositions:
    """Measured centers of objects that boxes have shown, for example from a depth camera."""

    object_id: ArrayLike
    """Shape (p,)."""
    object_in_robot: ArrayLike
    """Meters, shape (p, 3)."""
    covariance: ArrayLike
    """Square meters, shape (p, 3, 3)."""


@dataclass(frozen=True, eq=False)
class StepMeasurements:
    """Measurements of one kind, of objects that boxes have shown."""

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
    """The input of one step at a time."""

    timestamp: float
    """Seconds."""
    odometry: Motion | None
    """None for the first step only."""
    boxes: StepBoxes | None = None
    positions: StepPositions | None = None
    measurements: Sequence[StepMeasurements] = ()
