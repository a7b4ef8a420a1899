"""Judge an estimate by what can be known about it: its boxes, and a reference trajectory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association import CHI2_GATE
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.evaluation import common_poses
from dqslam.io import Trajectory
from dqslam.metrics import absolute_trajectory_error
from dqslam.recording import Detections


def box_chi2(estimate: Estimate, detections: Detections, noise: BoxNoise) -> NDArray[np.float64]:
    """Compare boxes with the estimate: chi-square with 4 dof, shape (m,).

    Infinite where the object is not in front of the camera that saw it, no ellipsoid, or dropped.
    """
    if not len(estimate.object_ids):
        return np.full(len(detections), np.inf)
    row = np.searchsorted(estimate.object_ids, detections.object_id).clip(
        max=len(estimate.object_ids) - 1
    )
    mapped = estimate.object_ids[row] == detections.object_id
    chi2 = _core.box_chi_squares(
        estimate.pose_model,
        estimate.camera,
        estimate.poses[detections.pose],
        estimate.ellipsoids[row],
        detections.box,
        noise.covariance(detections.box).reshape(-1, 16),
        detections.truncated,
    )
    return np.where(mapped, chi2, np.inf)


def trajectory_error(estimate: Estimate, reference: Trajectory) -> dict[str, Any]:
    """Compare the poses before and after with a reference, at the times that both have.

    ``ate_rmse_m`` is after rigid alignment; ``mean_m`` is the mean distance with the first common
    pose made equal, the paper's RMSE_pos.
    """
    model, camera = estimate.pose_model, estimate.camera
    common, row = common_poses(estimate.timestamps, reference)
    true = reference.world_from_camera[row]

    def error(poses: NDArray[np.float64]) -> dict[str, float]:
        cameras = _core.world_from_camera(model, camera, poses)[common]
        aligned = absolute_trajectory_error(cameras[:, :3], true[:, :3], align="se3")
        moved = _start_at(true[0], cameras)
        unaligned = absolute_trajectory_error(moved[:, :3], true[:, :3], align="none")
        return {"ate_rmse_m": aligned.rmse, "mean_m": unaligned.mean}

    return {
        "poses": len(common),
        "before": error(estimate.initial_poses),
        "after": error(estimate.poses),
    }


def _start_at(first: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move a path (n, 7) as a whole so that it starts at a given pose (7,)."""
    se3 = _core.PoseModel.SE3
    first_from_path = _core.between(se3, np.repeat(poses[:1], len(poses), axis=0), poses)
    return _core.compose(se3, np.repeat(first[None], len(poses), axis=0), first_from_path)


def describe_boxes(chi2: NDArray[np.float64]) -> dict[str, Any]:
    """Count the boxes and those that do not fit, from their chi-squares (m,)."""
    return {
        "count": len(chi2),
        "chi2_median": float(np.median(chi2)) if len(chi2) else None,
        "outlier_share": float(np.mean(chi2 > CHI2_GATE[4])) if len(chi2) else None,
        "not_in_front": int(np.sum(np.isinf(chi2))),
    }


def describe_objects(
    estimate: Estimate, detections: Detections, chi2: NDArray[np.float64]
) -> list[dict[str, Any]]:
    """Describe the boxes of each object."""
    return [
        {
            "id": int(object_id),
            "class_name": estimate.class_names[row],
            "observations": int(estimate.observations[row]),
            "ellipsoid": bool(estimate.is_ellipsoid[row]),
            **describe_boxes(chi2[detections.object_id == object_id]),
        }
        for row, object_id in enumerate(estimate.object_ids)
    ]


def describe_size_prior(prior: SizePrior | SizePriors) -> dict[str, Any]:
    """Describe one prior, or the default of a table and its classes."""
    if isinstance(prior, SizePriors):
        classes = {name: describe_size_prior(one) for name, one in prior.classes.items()}
        return describe_size_prior(prior.default) | {"classes": classes}
    return {"median_m": float(np.exp(prior.log_mean)), "log_sigma": prior.log_sigma}


def describe_solver(summary: _core.Summary) -> dict[str, Any]:
    """Say how the solver got there."""
    names = (
        "initial_cost",
        "final_cost",
        "iterations",
        "rejected_steps",
        "gradient_norm_start",
        "gradient_norm_end",
        "seconds",
        "converged",
        "message",
    )
    return {name: getattr(summary, name) for name in names}
