"""Estimate a real recording, and judge the result by what can be known about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.estimate import Estimate
from dqslam.evaluate import absolute_trajectory_error
from dqslam.io import OdometryNoise, Trajectory, nearest_pose
from dqslam.problem import BoxNoise, SizePrior, build_graph, solve
from dqslam.recording import Detections, Recording

# Detectors stop short of the image border by a pixel or two.
BORDER_PX = 3.0
# 99 % of the boxes of an object that is where the map says lie below this: chi-square, 4 dof.
CHI2_GATE = 13.28
# Boxes that locate an object together: odometry must not drift much while they are seen.
TRACK_LENGTH = 10
LOG_SIZE_SIGMA = 0.7


@dataclass(frozen=True)
class RunResult:
    """An estimate, how the solver got there, and its report, ready for JSON."""

    estimate: Estimate
    summary: _core.Summary
    report: dict[str, Any]


@dataclass(frozen=True)
class CutBoxNoise(BoxNoise):
    """Box noise where boxes end at the image: such an edge says nothing about the object.

    Its sigma is the size of the image, in place of the detector's.
    """

    camera: _core.Camera | None = None

    def covariance(self, box: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance [px^2] of u_min, v_min, u_max, v_max, shape (b, 4, 4)."""
        covariance = super().covariance(box)
        if self.camera is not None:
            size = float(max(self.camera.width, self.camera.height))
            row, edge = np.nonzero(cut_edges(self.camera, box))
            covariance[row, edge, edge] = size**2
        return covariance


def cut_edges(camera: _core.Camera, box: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which edges of undistorted boxes (b, 4) lie on the border of the image as recorded."""
    border = np.array([-0.5, -0.5, camera.width - 0.5, camera.height - 0.5])
    low, high = np.tile(border[:2], 2), np.tile(border[2:], 2)
    recorded = np.clip(box, low, high)
    if camera.has_distortion:
        for _ in range(10):  # until it undistorts to the box; the error halves at least
            recorded = np.clip(recorded + box - camera.undistort_boxes(recorded), low, high)
    return np.asarray(np.abs(recorded - border) <= BORDER_PX)


def default_options(mode: _core.Mode = _core.Mode.SLAM) -> _core.SolveOptions:
    """Choose the estimator for real detectors: outliers are many, so the loss is Cauchy's."""
    options = _core.SolveOptions()
    options.mode = mode
    options.loss = _core.Loss.CAUCHY
    options.loss_scale = 2.0
    return options


def perturb_odometry(
    recording: Recording,
    noise: OdometryNoise,
    *,
    seed: int,
    believed: OdometryNoise | None = None,
) -> Recording:
    """Add Gaussian noise to every step, for a trajectory that is better than odometry would be.

    The estimator is told the ``noise``, or what is ``believed`` of it instead.
    """
    odometry = recording.odometry
    steps = len(odometry.relative)
    sigma = np.repeat([noise.translation_m, noise.rotation_rad], 3)
    tangent = np.random.default_rng(seed).normal(0.0, sigma, (steps, 6))
    relative = _core.plus(odometry.pose_model, odometry.relative, tangent)
    covariance = (believed or noise).covariance(steps)
    return replace(recording, odometry=replace(odometry, relative=relative, covariance=covariance))


def scene_size_prior(recording: Recording) -> SizePrior:
    """Guess how large the objects of a recording are, to a factor of two.

    Table tops and streets differ a hundredfold, so the mean comes from the recording: the rays
    through the middles of an object's boxes meet at a distance, where the boxes have a size in
    metres. The median over the objects stands up to moving ones, wrong ids and drift; it
    was within 15 % of that of an error-free path. Within a recording the logarithms spread by
    0.3 to 0.65 (table tops, desks, streets), which the sigma covers.
    """
    detections = recording.detections
    cameras, rays = _rays(recording)
    guesses = []
    for object_id in np.unique(detections.object_id):
        rows = np.flatnonzero(detections.object_id == object_id)
        rows = rows[np.argsort(detections.pose[rows], kind="stable")]
        parts = [rows[i : i + TRACK_LENGTH] for i in range(0, len(rows), TRACK_LENGTH)]
        sizes = [_semi_axis(recording, part, cameras, rays) for part in parts if len(part) > 2]
        if np.any(np.isfinite(sizes)):
            guesses.append(np.nanmedian(sizes))
    if not guesses:
        return SizePrior(log_sigma=LOG_SIZE_SIGMA)
    return SizePrior(log_mean=float(np.median(np.log(guesses))), log_sigma=LOG_SIZE_SIGMA)


def _rays(recording: Recording) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return camera centres and points at depth 1 m on the boxes' middle rays: (m, 3) in world."""
    camera, detections, odometry = recording.camera, recording.detections, recording.odometry
    model = odometry.pose_model
    path = _core.dead_reckon(model, odometry.first_pose, odometry.relative)
    poses = _core.world_from_camera(model, camera, path)[detections.pose]
    u, v = (detections.box[:, :2] + detections.box[:, 2:]).T / 2
    points = np.zeros((len(u), 7))
    points[:, 0] = (u - camera.cx) / camera.fx
    points[:, 1] = (v - camera.cy) / camera.fy
    points[:, 2] = 1
    points[:, 6] = 1
    return poses[:, :3], _core.compose(_core.PoseModel.SE3, poses, points)[:, :3]


def _semi_axis(
    recording: Recording,
    rows: NDArray[np.int64],
    cameras: NDArray[np.float64],
    points: NDArray[np.float64],
) -> float:
    """Return the typical half size in metres where the rays of some boxes meet, else NaN."""
    ray = points[rows] - cameras[rows]
    length = np.linalg.norm(ray, axis=1)
    unit = ray / length[:, None]
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    information = across.sum(axis=0)
    if np.linalg.eigvalsh(information)[0] < 1e-9 * len(rows):
        return np.nan  # parallel rays
    met = np.linalg.solve(information, np.einsum("nij,nj->i", across, cameras[rows]))
    depth = np.einsum("ni,ni->n", met - cameras[rows], unit) / length
    if np.any(depth <= 0):
        return np.nan
    side = recording.detections.box[rows, 2:] - recording.detections.box[rows, :2]
    focal_area = recording.camera.fx * recording.camera.fy
    return float(np.median(depth * np.sqrt(side.prod(axis=1) / focal_area) / 2))


def run(
    recording: Recording,
    *,
    mode: _core.Mode = _core.Mode.SLAM,
    reference: Trajectory | None = None,
    box_noise: BoxNoise | None = None,
    size_prior: SizePrior | None = None,
    options: _core.SolveOptions | None = None,
) -> RunResult:
    """Estimate poses and objects of a recording, and report.

    Parameters
    ----------
    mode
        Whether the odometry is improved (SLAM) or taken as the truth (MAPPING).
    reference
        The trajectory to compare with, before and after; it may be in another world frame.
    box_noise, size_prior, options
        What to assume; by default ``CutBoxNoise``, ``scene_size_prior``, ``default_options``.
    """
    noise = box_noise or CutBoxNoise(camera=recording.camera)
    prior = size_prior or scene_size_prior(recording)
    graph = build_graph(recording, box_noise=noise, size_prior=prior)
    estimate, summary = solve(graph, options or default_options(mode))
    chi2 = box_chi2(estimate, recording.detections, noise)
    report = {
        "mode": mode.name.lower(),
        "poses": len(estimate.timestamps),
        "boxes": _describe_boxes(chi2),
        "objects": _describe_objects(estimate, recording.detections, chi2),
        "box_noise": {"pixels": noise.pixels, "relative": noise.relative},
        "size_prior": {"median_m": float(np.exp(prior.log_mean)), "log_sigma": prior.log_sigma},
        "trajectory_error": None if reference is None else trajectory_error(estimate, reference),
        "solver": {
            name: getattr(summary, name)
            for name in (
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
        },
    }
    return RunResult(estimate, summary, report)


def box_chi2(estimate: Estimate, detections: Detections, noise: BoxNoise) -> NDArray[np.float64]:
    """Compare boxes with the estimate: chi-square with 4 dof, shape (m,).

    Infinite where the object is not in front of the camera that saw it, or no ellipsoid.
    """
    row = np.searchsorted(estimate.object_ids, detections.object_id)
    predicted, in_front = _core.project_to_boxes(
        estimate.pose_model,
        estimate.camera,
        estimate.poses[detections.pose],
        np.where(estimate.is_ellipsoid[:, None], estimate.ellipsoids, 1.0)[row],
    )
    error = predicted - detections.box
    sigma = np.sqrt(np.diagonal(noise.covariance(detections.box), axis1=1, axis2=2))
    chi2 = np.sum((error / sigma) ** 2, axis=1)
    return np.where(in_front & estimate.is_ellipsoid[row], chi2, np.inf)


def trajectory_error(estimate: Estimate, reference: Trajectory) -> dict[str, Any]:
    """Compare the poses before and after with a reference, at the times that both have.

    ``ate_rmse_m`` is after rigid alignment; ``mean_m`` is the mean distance with the first common
    pose made equal, the paper's RMSE_pos.
    """
    model, camera = estimate.pose_model, estimate.camera
    interval = min(_interval(estimate.timestamps), _interval(reference.timestamps))
    row, late = nearest_pose(reference.timestamps, estimate.timestamps)
    common = np.flatnonzero(late <= 0.5 * interval)
    if len(common) < 3:
        raise ValueError(
            f"groundtruth: {len(common)} poses within {0.5 * interval:g} s of the odometry's; "
            "3 are needed"
        )
    true = reference.world_from_camera[row[common]]

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


def _interval(times: NDArray[np.float64]) -> float:
    return float(np.median(np.diff(times)))


def _describe_boxes(chi2: NDArray[np.float64]) -> dict[str, Any]:
    return {
        "count": len(chi2),
        "chi2_median": float(np.median(chi2)),
        "outlier_share": float(np.mean(chi2 > CHI2_GATE)),
        "not_in_front": int(np.sum(np.isinf(chi2))),
    }


def _describe_objects(
    estimate: Estimate, detections: Detections, chi2: NDArray[np.float64]
) -> list[dict[str, Any]]:
    return [
        {
            "id": int(object_id),
            "class_name": estimate.class_names[row],
            "observations": int(estimate.observations[row]),
            "ellipsoid": bool(estimate.is_ellipsoid[row]),
            **_describe_boxes(chi2[detections.object_id == object_id]),
        }
        for row, object_id in enumerate(estimate.object_ids)
    ]
