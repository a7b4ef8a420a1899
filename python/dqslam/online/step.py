"""What arrives at one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray


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
class Step:
    """All that arrives at one time."""

    timestamp: float
    """Seconds."""
    odometry: Motion | None
    """None for the first step only."""
    boxes: StepBoxes | None = None
    positions: StepPositions | None = None


@dataclass(frozen=True, eq=False)
class CheckedBoxes:
    """Boxes whose shapes fit."""

    box: NDArray[np.float64]
    object_id: NDArray[np.int64]
    class_name: Sequence[str]
    truncated: NDArray[np.bool_]
    ids: list[int] = field(default_factory=list)

    def select(self, object_id: NDArray[np.int64]) -> CheckedBoxes:
        """Return the boxes that show an object, with these ids (b,); -1 for none."""
        rows = np.flatnonzero(object_id >= 0)
        return CheckedBoxes(
            self.box[rows],
            object_id[rows],
            [self.class_name[row] for row in rows.tolist()],
            self.truncated[rows],
            object_id[rows].tolist(),
        )


_NO_BOXES = CheckedBoxes(
    np.zeros((0, 4)), np.zeros(0, dtype=np.int64), (), np.zeros((0, 4), dtype=np.bool_)
)


def check_boxes(boxes: StepBoxes | None) -> CheckedBoxes:
    """Return the boxes as arrays; ValueError names what does not fit. The core checks numbers."""
    if boxes is None:
        return _NO_BOXES
    box = np.asarray(boxes.box, dtype=np.float64)
    if box.size == 0:
        return _NO_BOXES
    count = len(box)
    if box.shape != (count, 4):
        raise ValueError(f"boxes: expected shape (n, 4), got {box.shape}")
    if not np.isfinite(box).all():
        row = int(np.flatnonzero(~np.isfinite(box).all(axis=1))[0])
        raise ValueError(f"boxes row {row}: NaN or infinite: {box[row].tolist()}")
    object_id = np.asarray(boxes.object_id)
    if object_id.shape != (count,) or object_id.dtype.kind not in "iu":
        raise ValueError(f"object_id: expected {count} whole numbers")
    ids = object_id.tolist()
    if min(ids) < -1:
        raise ValueError(f"object_id row {ids.index(min(ids))}: not an object id: {min(ids)}")
    names = boxes.class_name or ("object",) * count
    if len(names) != count:
        raise ValueError(f"class_name: expected {count} names, got {len(names)}")
    if boxes.truncated is None:
        truncated = np.zeros((count, 4), dtype=np.bool_)
    else:
        truncated = np.asarray(boxes.truncated, dtype=np.bool_)
        if truncated.shape != (count, 4):
            raise ValueError(f"truncated: expected shape ({count}, 4), got {truncated.shape}")
    return CheckedBoxes(box, object_id.astype(np.int64), names, truncated, ids)
