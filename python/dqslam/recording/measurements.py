"""Measurements between poses and objects, other than boxes."""

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints, as_covariances, as_floats, as_ints, assign
from dqslam._repr import counted


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements of one kind between poses and objects, with m numbers each.

    Kinds are those of the core: "position" (m = 3, the center in the robot frame, meters) and
    "range" (m = 1, the distance from the robot to the center, meters).
    """

    kind: str
    pose: Ints
    """Row of the pose from which it was measured, shape (p,)."""
    object_id: Ints
    """Shape (p,)."""
    value: Floats
    """Shape (p, m)."""
    covariance: Floats
    """Shape (p, m, m)."""

    def __post_init__(self) -> None:
        """Check shapes and numbers; the core knows the kinds."""
        value = as_floats(f"{self.kind}s.value", self.value, [None, None])
        count, size = value.shape
        assign(
            self,
            pose=as_ints(f"{self.kind}s.pose", self.pose, count),
            object_id=as_ints(f"{self.kind}s.object_id", self.object_id, count),
            value=value,
            covariance=as_covariances(f"{self.kind}s.covariance", self.covariance, count, size),
        )

    def __len__(self) -> int:
        """Return the number of measurements."""
        return len(self.value)

    def __repr__(self) -> str:
        """Show how many measurements there are, and of how many objects."""
        objects = counted(len(np.unique(self.object_id)), "object")
        return f"Measurements({counted(len(self), self.kind)} of {objects})"
