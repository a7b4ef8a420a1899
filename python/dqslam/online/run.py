"""A recording replayed through a session: what ``dqslam run --online`` does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from dqslam import _core
from dqslam.associate import CHI2_GATE, FINAL, not_found
from dqslam.io import Trajectory
from dqslam.online.replay import Frame, replay
from dqslam.online.slam import OnlineSlam
from dqslam.problem import BoxNoise, build_graph
from dqslam.recording import Detections, Recording
from dqslam.run_recording import RunResult, box_chi2, trajectory_error, with_cut_edges
from dqslam.run_recording.hold_out import describe_overlap, overlap_with_map
from dqslam.run_recording.report import (
    describe_boxes,
    describe_objects,
    describe_size_prior,
    describe_solver,
)
from dqslam.size_prior import SizePrior, SizePriors
from dqslam.uncertainty import Marginals, marginal_covariances


def run_online(
    recording: Recording,
    *,
    trust_ids: float = FINAL,
    reference: Trajectory | None = None,
    box_noise: BoxNoise | None = None,
    size_prior: SizePrior | SizePriors | None = None,
    estimates_noise: bool = False,
    show: Callable[[OnlineSlam, Frame], None] = lambda slam, frame: None,
) -> RunResult:
    """Estimate a recording step by step, polish at the end, and report as ``run`` does.

    Parameters are those of ``run_recording.run``; ``show`` is called after each step. The loss is
    Cauchy's.
    """
    noise = box_noise or BoxNoise()
    recording = with_cut_edges(recording)
    detections = recording.detections
    options = _core.SolveOptions(loss=_core.Loss.CAUCHY, loss_scale=2.0)
    slam = OnlineSlam(
        recording.camera,
        options,
        pose_model=recording.odometry.pose_model,
        first_pose=recording.odometry.first_pose,
        box_noise=noise,
        size_prior=size_prior,
        trust_ids=trust_ids,
        finds_movers=True,
        estimates_noise=estimates_noise,
    )
    times = []
    for frame in replay(slam, recording):
        times.append(frame.milliseconds)
        show(slam, frame)
    live = slam.trajectory
    polished = slam.polish().result()
    estimate = slam.estimate()
    if trust_ids == FINAL:
        object_id = detections.object_id
        ids = np.array([*slam.objects.ids, *slam.left_out])
        used = np.isin(detections.pose, slam.keyframes)
        dropped = {**estimate.dropped, **not_found(recording, ids, used)}
        estimate = replace(estimate, dropped=dict(sorted(dropped.items())))
    else:
        object_id = np.full(len(detections), -1)
        object_id[np.argsort(detections.pose, kind="stable")] = np.concatenate(slam.assignments)
    assigned = replace(detections, object_id=object_id)
    shown = assigned.select(object_id >= 0)
    marginals = _marginals(slam, recording, shown, noise)
    chi2 = box_chi2(estimate, shown, noise)
    mapped = np.isin(shown.object_id, estimate.object_ids)
    estimate = replace(estimate, inliers=chi2 <= CHI2_GATE[4])
    tested = detections
    if trust_ids < FINAL:
        tested = replace(detections, object_id=np.full(len(detections), -1))
    overlap, _ = overlap_with_map(estimate, tested)
    error = None if reference is None else trajectory_error(estimate, reference)
    if error is not None and reference is not None:
        error["live"] = trajectory_error(replace(estimate, poses=live), reference)["after"]
    report: dict[str, Any] = {
        "mode": "slam",
        "online": _describe_times(np.array(times)),
        "poses": len(estimate.timestamps),
        "keyframes": len(slam.keyframes) or len(estimate.timestamps),
        "boxes": describe_boxes(chi2[mapped])
        | {
            "of_dropped_objects": int(np.sum(~mapped)),
            "unassigned": int(np.sum(object_id < 0)),
        },
        "objects": describe_objects(estimate, shown, chi2),
        "dropped_objects": {str(name): why for name, why in estimate.dropped.items()},
        "size_prior": describe_size_prior(slam.size_prior),
        "reprojection": describe_overlap(overlap) | {"held_out": False},
        "box_noise": {"pixels": noise.pixels, "relative": noise.relative},
        "odometry_noise": _describe_noise(slam),
        "under_constrained": [] if marginals is None else list(marginals.under_constrained),
        "trajectory_error": error,
        "solver": None if polished.summary is None else describe_solver(polished.summary),
    }
    held_out = np.zeros(len(detections), dtype=np.bool_)
    return RunResult(estimate, assigned, held_out, marginals, polished.summary, report)


def _marginals(
    slam: OnlineSlam, recording: Recording, boxes: Detections, noise: BoxNoise
) -> Marginals | None:
    """Return the covariances of what a polish has found, from the boxes that took part."""
    estimate = slam.estimate()
    part = np.isin(boxes.object_id, estimate.object_ids)
    if len(slam.keyframes):
        part &= np.isin(boxes.pose, slam.keyframes)
    if not part.any():
        return None
    used = replace(recording, detections=boxes.select(part))
    if slam.odometry_noise is not None:
        covariance = slam.odometry_noise.covariance(len(recording.odometry.relative))
        used = replace(used, odometry=replace(recording.odometry, covariance=covariance))
    graph = build_graph(used, box_noise=noise, size_prior=slam.size_prior)
    return marginal_covariances(graph, estimate, slam.solve_options)


def _describe_noise(slam: OnlineSlam) -> dict[str, Any]:
    noise = slam.odometry_noise
    return {"from": "given"} if noise is None else {"from": "estimated"} | asdict(noise)


def _describe_times(milliseconds: np.ndarray) -> dict[str, float]:
    """Summarise the wall clock of all steps."""
    return {
        "step_ms_median": float(np.median(milliseconds)),
        "step_ms_p99": float(np.percentile(milliseconds, 99)),
        "step_ms_worst": float(milliseconds.max()),
        "total_s": float(milliseconds.sum() / 1e3),
    }


def describe_step(slam: OnlineSlam, frame: Frame) -> str:
    """Say in a line where the robot is, how many objects it knows, and what the step took."""
    pose = slam.pose
    place = " ".join(f"{entry:.2f}" for entry in pose[: 2 if len(pose) == 3 else 3])
    return f"step {len(slam)}: at {place} m, {slam.count} objects, {frame.milliseconds:.2f} ms"
