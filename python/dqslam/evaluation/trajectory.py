"""A trajectory compared with the true one, at the times that both have."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.io import Trajectory, nearest_pose
from dqslam.metrics import (
    Align,
    absolute_trajectory_error,
    align_positions,
    relative_pose_error,
)

FEWEST_POSES = 3


def common_poses(
    timestamps: Floats, truth: Trajectory, max_time_difference: float | None = None
) -> tuple[Ints, Ints]:
    """Return the rows of the poses that have a true one near in time, and those of the true ones.

    Near means within ``max_time_difference`` s, by default half the smaller median interval of
    the two.

    Raises
    ------
    ValueError
        If there are fewer than three.
    """
    tolerance = max_time_difference
    if tolerance is None:
        tolerance = 0.5 * min(_interval(timestamps), _interval(truth.timestamps))
    rows = true_rows = np.zeros(0, dtype=np.int64)
    if len(truth.timestamps) >= FEWEST_POSES:
        nearest, late = nearest_pose(truth.timestamps, timestamps)
        rows = np.flatnonzero(late <= tolerance)
        true_rows = nearest[rows]
    if len(rows) < FEWEST_POSES:
        raise ValueError(
            f"groundtruth: {len(rows)} poses within {tolerance:g} s of the estimate's "
            f"({timestamps[0]:.6f} to {timestamps[-1]:.6f} s, groundtruth "
            f"{truth.timestamps[0]:.6f} to {truth.timestamps[-1]:.6f} s); {FEWEST_POSES} are needed"
        )
    return rows, true_rows


def judge_trajectory(
    poses: Floats,
    true_poses: Floats,
    *,
    align: Align,
    rpe_delta: float,
    rpe_unit: Literal["frames", "meters"],
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the absolute and the relative errors of poses, both (n, 7), row by row.

    The relative errors are also taken after the alignment, of which only the scale has an effect.
    """
    alignment = align_positions(poses[:, :3], true_poses[:, :3], align)
    absolute = absolute_trajectory_error(poses[:, :3], true_poses[:, :3], align=align)
    relative = relative_pose_error(
        alignment.apply_poses(poses), true_poses, delta=rpe_delta, unit=rpe_unit
    )
    names = ("rmse", "mean", "median", "max")
    ate = {name: getattr(absolute, name) for name in names}
    if align == "sim3":
        ate["scale"] = alignment.scale
    return ate, {"delta": rpe_delta, "unit": rpe_unit, **asdict(relative)}


def _interval(times: Floats) -> float:
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0
