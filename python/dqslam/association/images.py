"""The boxes of each image."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Ints


def group_by_pose(pose: Ints) -> list[tuple[int, Ints]]:
    """Return poses in order of time, each with the rows of its boxes; ``pose`` is theirs, (m,)."""
    order = np.argsort(pose, kind="stable")
    poses, starts = np.unique(pose[order], return_index=True)
    groups = np.split(order, starts)[1:]  # what is before the first start is empty
    return list(zip(poses.tolist(), groups, strict=True))
