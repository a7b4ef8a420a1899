"""Measured positions of objects, for example from a depth camera."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from dqslam._checks import (
    Bools,
    Floats,
    Ints,
    as_covariances,
    as_floats,
    as_ints,
    assign,
    reject_large,
)
from dqslam._limits import LARGEST_COORDINATE_M
from dqslam._repr import counted


@dataclass(frozen=True, eq=False)
class RelativePositions:
    """Measured centers of objects relative to the robot, for example from a depth camera."""

    pose: Ints
    """Row of the pose from which it was measured, shape (p,)."""
    object_id: Ints
    """Shape (p,)."""
    object_in_robot: Floats
    """Meters, shape (p, 3)."""
    covariance: Floats
    """Square meters, shape (p, 3, 3)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers."""
        object_in_robot = as_floats("positions.object_in_robot", self.object_in_robot, [None, 3])
        reject_large("positions.object_in_robot", object_in_robot, LARGEST_COORDINATE_M, "m")
        count = len(object_in_robot)
        assign(
            self,
            pose=as_ints("positions.pose", self.pose, count),
            object_id=as_ints("positions.object_id", self.object_id, count),
            object_in_robot=object_in_robot,
            covariance=as_covariances("positions.covariance", self.covariance, count, 3),
        )

    def __len__(self) -> int:
        """Return the number of measurements."""
        return len(self.object_in_robot)

    def __repr__(self) -> str:
        """Show how many measurements there are, and of how many objects."""
        objects = counted(len(np.unique(self.object_id)), "object")
        return f"RelativePositions({counted(len(self), 'position')} of {objects})"

    def select(self, rows: Ints | Bools) -> Self:
        """Return some of the measurements: their rows, or a flag for each (p,)."""
        names = ("pose", "object_id", "object_in_robot", "covariance")
        return replace(self, **{name: getattr(self, name)[rows] for name in names})
