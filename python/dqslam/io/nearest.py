"""The pose of a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def nearest_pose(
    pose_times: NDArray[np.float64], times: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the pose nearest in time to each of ``times`` (m,): its row, and the difference in s."""
    after = np.clip(np.searchsorted(pose_times, times), 1, len(pose_times) - 1)
    nearer_before = times - pose_times[after - 1] <= pose_times[after] - times
    pose = (after - nearer_before).astype(np.int64)
    return pose, np.abs(pose_times[pose] - times)
