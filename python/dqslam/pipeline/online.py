"""A recording replayed through a session: what ``dqslam run --online`` does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam.association import FINAL, not_found
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.graph import build_graph
from dqslam.io import Trajectory
from dqslam.online.replay import Frame, replay
from dqslam.online.slam import OnlineSlam
from dqslam.pipeline import (
    Outcome,
    RunResult,
    choose_held_out,
    conclude,
    trajectory_error,
    with_cut_edges,
)
from dqslam.recording import Detections, Recording
from dqslam.uncertainty import Marginals, marginal_covariances


def run_online(
    recording: Recording,
    *,
    trust_ids: float = FINAL,
    reference: Trajectory | None = None,
    box_noise: BoxNoise | None = None,
    size_prior: SizePrior | SizePriors | None = None,
    estimates_noise: bool = False,
    hold_out: float = 0.0,
    seed: int = 0,
    show: Callable[[OnlineSlam, Frame], None] = lambda slam, frame: None,
) -> RunResult:
    """Estimate a recording step by step, polish at the end, and report as ``run`` does.

    Parameters are those of ``pipeline.run``; ``show`` is called after each step. The loss is
    Cauchy's.
    """
    noise = box_noise or BoxNoise()
    recording = with_cut_edges(recording)
    detections = recording.detections
    held_out = choose_held_out(len(detections), hold_out, seed=seed)
    known = replace(recording, detections=detections.select(~held_out))
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
    for frame in replay(slam, known):
        times.append(frame.milliseconds)
        show(slam, frame)
    live = slam.poses
    polished = slam.polish().result()
    final = trust_ids == FINAL
    object_id = detections.object_id.copy()
    if not final:
        rows = np.flatnonzero(~held_out)
        order = np.argsort(known.detections.pose, kind="stable")
        object_id[rows[order]] = np.concatenate(slam.assignments)
    shown = replace(detections, object_id=object_id)
    outcome = Outcome(
        _estimate(slam, known) if final else slam.estimate(),
        _marginals(slam, recording, shown.select(~held_out & (object_id >= 0)), noise),
        polished.summary,
        mode=_core.Mode.SLAM,
        keyframes=len(slam.keyframes),
        box_noise=noise,
        size_prior=slam.size_prior,
        odometry_noise=slam.odometry_noise,
    )
    result = conclude(outcome, shown, held_out, ids_are_final=final, reference=reference)
    report = result.report | {"online": _describe_times(np.array(times))}
    if reference is not None:
        error = trajectory_error(replace(result.estimate, poses=live), reference)["after"]
        report["trajectory_error"] = result.report["trajectory_error"] | {"live": error}
    return replace(result, report=report)


def _estimate(slam: OnlineSlam, recording: Recording) -> Estimate:
    """Return the estimate, and say of final ids without an object why that is."""
    estimate = slam.estimate()
    ids = np.array([*slam.objects.object_ids, *slam.left_out], dtype=np.int64)
    used = np.isin(recording.detections.pose, slam.keyframes)
    dropped = {**estimate.dropped, **not_found(recording, ids, used)}
    return replace(estimate, dropped=dict(sorted(dropped.items())))


def _marginals(
    slam: OnlineSlam, recording: Recording, boxes: Detections, noise: BoxNoise
) -> Marginals | None:
    """Return the covariances of what a polish has found, from the boxes that took part."""
    estimate = slam.estimate()
    part = np.isin(boxes.object_id, estimate.object_ids) & np.isin(boxes.pose, slam.keyframes)
    if not part.any():
        return None
    used = replace(recording, detections=boxes.select(part))
    if slam.odometry_noise is not None:
        covariance = slam.odometry_noise.covariance(len(recording.odometry.relative))
        used = replace(used, odometry=replace(recording.odometry, covariance=covariance))
    graph = build_graph(used, box_noise=noise, size_prior=slam.size_prior)
    return marginal_covariances(graph, estimate, slam.solve_options)


def _describe_times(milliseconds: np.ndarray) -> dict[str, float]:
    """Summarize the wall clock of all steps."""
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
    return (
        f"step {len(slam)}: at {place} m, {slam.num_objects} objects, {frame.milliseconds:.2f} ms"
    )
