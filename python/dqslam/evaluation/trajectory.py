"""A trajectory compared with the true one, at the times that both have."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.estimate import Estimate
from dqslam.io import Trajectory, nearest_pose
from dqslam.metrics import (
    Align,
    absolute_trajectory_error,
    align_positions,
    mean_distance,
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


def evaluate_trajectory(
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


def trajectory_error(
    estimate: Estimate, reference: Trajectory, *, live_poses: Floats | None = None
) -> dict[str, Any]:
    """Compare the poses before and after with a reference, at the times that both have.

    And those of a session before its last polish, world_from_robot, shape (n, d). ``ate_rmse_m`` is
    after rigid alignment; ``mean_m`` is the mean distance with the first common pose made equal,
    the paper's RMSE_pos.
    """
    common, row = common_poses(estimate.timestamps, reference)
    true = reference.world_from_camera[row]

    def error(poses: Floats) -> dict[str, float]:
        cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, poses)[common]
        aligned = absolute_trajectory_error(cameras[:, :3], true[:, :3])
        moved = _start_at(true[0], cameras)
        return {"ate_rmse_m": aligned.rmse, "mean_m": mean_distance(moved[:, :3], true[:, :3])}

    paths = {"before": estimate.initial_poses, "after": estimate.poses, "live": live_poses}
    errors = {name: error(poses) for name, poses in paths.items() if poses is not None}
    return {"poses": len(common)} | errors


def _start_at(first: Floats, poses: Floats) -> Floats:
    """Move a path (n, 7) as a whole so that it starts at a given pose (7,)."""
    se3 = _core.PoseModel.SE3
    first_from_path = _core.between(se3, np.repeat(poses[:1], len(poses), axis=0), poses)
    return _core.compose(se3, np.repeat(first[None], len(poses), axis=0), first_from_path)


def _interval(times: Floats) -> float:
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0
