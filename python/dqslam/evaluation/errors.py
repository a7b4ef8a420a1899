"""Errors of each pose against the truth, with the uncertainty of the estimate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats
from dqslam._core import PoseModel
from dqslam.evaluation.trajectory import common_poses
from dqslam.io import Results, Trajectory
from dqslam.metrics import Align, Alignment, align_positions
from dqslam.uncertainty import tangent_errors

# Eigenvalues of correlations, below which a direction is one that a pose does not have. Files have
# nine digits.
RANK_TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Errors at the times that estimate and truth have in common, along axes of the true world."""

    timestamps: Floats
    """Seconds, shape (k,)."""
    distance: Floats
    """Absolute trajectory error: distance after the alignment of ``dqslam evaluate``, (k,) m."""
    odometry_distance: Floats
    """Absolute trajectory error of the odometry, which is aligned by itself, (k,) m."""
    position: Floats
    """Estimate - truth [m] with equal first poses, shape (k, 3)."""
    position_sigma: Floats
    """Standard deviation of the position by the estimate [m], shape (k, 3); NaN where unknown."""
    rotation: Floats
    """Rotation vector from truth to estimate [rad] with equal first poses, shape (k, 3)."""
    rotation_sigma: Floats
    """Standard deviation of the rotation by the estimate [rad], shape (k, 3)."""


def pose_errors(
    results: Results,
    groundtruth: Trajectory,
    *,
    align: Align = "se3",
    max_time_difference: float | None = None,
) -> PoseErrors:
    """Compare the poses of an estimate with the true ones, one by one.

    Distances are those that ``evaluate_results`` summarizes. Vectors are instead relative to the
    first common pose, for so are the covariances; with ``align`` "none" worlds are taken as they
    are.
    """
    from scipy.spatial.transform import Rotation

    rows, true_rows = common_poses(results.timestamps, groundtruth, max_time_difference)
    poses, true_poses = results.poses[rows], groundtruth.world_from_camera[true_rows]

    def distance(positions: Floats) -> Floats:
        moved = align_positions(positions, true_poses[:, :3], align).apply(positions)
        return np.asarray(np.linalg.norm(moved - true_poses[:, :3], axis=1))

    start = _same_start(poses, true_poses, align)
    moved = start.apply_poses(poses)
    turn = Rotation.from_quat(moved[:, 3:])
    in_world = turn.as_matrix()
    covariance = results.covariances[rows]
    return PoseErrors(
        timestamps=results.timestamps[rows],
        distance=distance(poses[:, :3]),
        odometry_distance=distance(results.initial_poses[rows, :3]),
        position=moved[:, :3] - true_poses[:, :3],
        position_sigma=start.scale * _sigmas(in_world, covariance[:, :3, :3]),
        rotation=(turn * Rotation.from_quat(true_poses[:, 3:]).inv()).as_rotvec(),
        rotation_sigma=_sigmas(in_world, covariance[:, 3:, 3:]),
    )


def pose_nees(
    results: Results,
    groundtruth: Trajectory,
    *,
    align: Align = "se3",
    max_time_difference: float | None = None,
) -> dict[str, float | int] | None:
    """Return mean and median of the squared errors of poses in sigmas, per degree of freedom.

    Errors are in exponential coordinates and relative to the first pose, as the covariances are:
    the logarithm of the motion in SE(3) from an estimated pose to the true one. On the plane, and
    where else a covariance has no rank in a direction, the error in that direction does not count.
    None where the first pose has no true one, or no other pose has both a true one and a
    covariance, as where poses were given.
    """
    rows, true_rows = common_poses(results.timestamps, groundtruth, max_time_difference)
    if rows[0] != 0:
        return None
    known = np.isfinite(results.covariances[rows]).all(axis=(1, 2))
    known &= rows > 0
    # Poses that were given, not estimated, have a covariance of zero.
    known &= (np.diagonal(results.covariances[rows], axis1=1, axis2=2) > 0.0).any(axis=1)
    if not known.any():
        return None
    poses, true_poses = results.poses[rows], groundtruth.world_from_camera[true_rows]
    moved = _same_start(poses, true_poses, "none" if align == "none" else "se3").apply_poses(poses)
    errors = tangent_errors(PoseModel.SE3, true_poses[known], moved[known])
    covariance = results.covariances[rows][known]
    variance = np.diagonal(covariance, axis1=1, axis2=2).reshape(-1, 2, 3)
    has_any = variance > RANK_TOLERANCE**2 * variance.max(axis=2, keepdims=True)
    unit = np.where(has_any, np.sqrt(variance.clip(min=0.0)), np.inf).reshape(-1, 6)
    correlation = covariance / (unit[:, :, None] * unit[:, None, :])
    values, vectors = np.linalg.eigh(correlation)
    has_rank = values > RANK_TOLERANCE
    along = np.einsum("nij,ni->nj", vectors, errors / unit)
    squares = np.where(has_rank, along**2 / np.where(has_rank, values, 1.0), 0.0).sum(axis=1)
    nees = squares / has_rank.sum(axis=1)
    return {
        "poses": int(known.sum()),
        "mean": float(nees.mean()),
        "median": float(np.median(nees)),
    }


def _same_start(poses: Floats, true_poses: Floats, align: Align) -> Alignment:
    """Return the motion that makes the first pose equal, with the scale of an alignment."""
    from scipy.spatial.transform import Rotation

    if align == "none":
        return Alignment(np.eye(3), np.zeros(3))
    scale = align_positions(poses[:, :3], true_poses[:, :3], align).scale
    turn, true_turn = (Rotation.from_quat(given[0, 3:]) for given in (poses, true_poses))
    rotation = (true_turn * turn.inv()).as_matrix()
    return Alignment(rotation, true_poses[0, :3] - scale * rotation @ poses[0, :3], scale)


def _sigmas(in_world: Floats, covariance: Floats) -> Floats:
    """Return standard deviations along the axes of the world, (k, 3), of covariances (k, 3, 3)."""
    variance = np.einsum("nij,njk,nik->ni", in_world, covariance, in_world)
    return np.asarray(np.sqrt(variance.clip(min=0.0)))
