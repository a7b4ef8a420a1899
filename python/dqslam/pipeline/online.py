"""A recording replayed through a session, step by step, and polished at the end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools
from dqslam.association import FINAL, not_found
from dqslam.assumptions import BoxNoise
from dqslam.estimate import Estimate
from dqslam.graph import Graph, build_graph, solve
from dqslam.online.replay import Frame, replay
from dqslam.online.slam import OnlineSlam
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.moving import moving_objects
from dqslam.pipeline.options import Progress, RunOptions
from dqslam.recording import Recording
from dqslam.uncertainty import Marginals, marginal_covariances


def estimate_online(
    recording: Recording, options: RunOptions, progress: Progress
) -> EstimatorOutput:
    """Feed a recording to a session as it would arrive, and polish what the session has found."""
    box_noise = options.box_noise or BoxNoise()
    slam = OnlineSlam(
        recording.camera,
        options.solve_options(),
        pose_model=recording.odometry.pose_model,
        first_pose=recording.odometry.first_pose,
        box_noise=box_noise,
        size_prior=options.size_prior,
        trust_ids=options.trust_ids,
        finds_movers=True,
        estimates_noise=options.estimates_noise,
    )
    step_ms = []
    for frame in replay(slam, recording):
        step_ms.append(frame.milliseconds)
        if options.watch is not None:
            options.watch(slam, frame.step)
        progress(len(slam) / len(recording.timestamps), _describe_step(slam, frame))
    live_poses = slam.poses
    summary = slam.polish().result().summary
    is_final = options.trust_ids == FINAL
    given = recording.detections.object_id
    order = np.argsort(recording.detections.pose, kind="stable")
    found = np.full(len(given), -1)
    found[order] = np.concatenate(slam.assignments)
    object_id = np.where(found < 0, given, found) if is_final else found
    shown = replace(recording, detections=replace(recording.detections, object_id=object_id))
    estimate = _estimate(slam, recording) if is_final else slam.estimate()
    believed = _with_believed_noise(slam, shown)
    moving = moving_objects(estimate, believed, box_noise, options)
    if moving:
        estimate = _without(moving, slam, estimate, believed, box_noise)
    return EstimatorOutput(
        estimate,
        _marginals(slam, estimate, believed, box_noise),
        summary,
        object_id=object_id,
        keyframes=len(slam.keyframes),
        size_prior=slam.size_prior,
        box_noise=box_noise,
        odometry_noise=slam.odometry_noise,
        live_poses=live_poses,
        step_ms=np.array(step_ms),
        took_part=np.isin(recording.detections.pose, slam.keyframes),
    )


def _estimate(slam: OnlineSlam, recording: Recording) -> Estimate:
    """Return the estimate, and say of final ids without an object why that is."""
    estimate = slam.estimate()
    ids = np.array([*slam.objects.object_ids, *slam.dropped], dtype=np.int64)
    used = np.isin(recording.detections.pose, slam.keyframes)
    dropped = {**estimate.dropped, **not_found(recording, ids, used)}
    return replace(estimate, dropped=dict(sorted(dropped.items())))


def _without(
    moving: dict[int, str],
    slam: OnlineSlam,
    estimate: Estimate,
    recording: Recording,
    noise: BoxNoise,
) -> Estimate:
    """Return the estimate without objects that a session has mapped although they move."""
    stays = ~np.isin(estimate.object_ids, list(moving))
    dropped = dict(sorted({**estimate.dropped, **moving}.items()))
    rest = _selected(estimate, stays)
    graph = _problem(slam, rest, recording, noise)
    if graph is None:
        return replace(rest, poses=estimate.initial_poses, dropped=dropped)
    rows = np.searchsorted(rest.object_ids, graph.object_ids)
    start = _core.State(rest.poses, rest.ellipsoids[rows])
    solved, _ = solve(graph, slam.solve_options, start=start)
    kept = _selected(rest, np.isin(rest.object_ids, solved.object_ids))
    return replace(
        kept,
        poses=solved.poses,
        ellipsoids=solved.ellipsoids,
        dual_quadrics=solved.dual_quadrics,
        dropped=dict(sorted({**dropped, **solved.dropped}.items())),
    )


def _selected(estimate: Estimate, rows: Bools) -> Estimate:
    """Return some of the objects of an estimate, by a flag for each (o,)."""
    ids = estimate.object_ids[rows].tolist()
    return replace(
        estimate,
        object_ids=estimate.object_ids[rows],
        class_names=tuple(estimate.class_names[row] for row in np.flatnonzero(rows).tolist()),
        observations=estimate.observations[rows],
        dual_quadrics=estimate.dual_quadrics[rows],
        ellipsoids=estimate.ellipsoids[rows],
        contradicted={one: why for one, why in estimate.contradicted.items() if one in ids},
    )


def _with_believed_noise(slam: OnlineSlam, recording: Recording) -> Recording:
    """Return the recording with the covariances of its steps that the session believes."""
    if slam.odometry_noise is None:
        return recording
    odometry = recording.odometry
    steps = slam.odometry_noise.covariance(len(odometry.relative), odometry.pose_model)
    return replace(recording, odometry=replace(odometry, covariance=steps))


def _problem(
    slam: OnlineSlam, estimate: Estimate, recording: Recording, noise: BoxNoise
) -> Graph | None:
    """Lay out the boxes of keyframes that show objects of an estimate; None without any."""
    boxes = recording.detections
    part = np.isin(boxes.object_id, estimate.object_ids) & np.isin(boxes.pose, slam.keyframes)
    if not part.any():
        return None
    used = replace(recording, detections=boxes.select(part))
    return build_graph(used, box_noise=noise, size_prior=slam.size_prior)


def _marginals(
    slam: OnlineSlam, estimate: Estimate, recording: Recording, noise: BoxNoise
) -> Marginals | None:
    """Return the covariances of what a polish has found, from the boxes that took part."""
    graph = _problem(slam, estimate, recording, noise)
    return None if graph is None else marginal_covariances(graph, estimate, slam.solve_options)


def _describe_step(slam: OnlineSlam, frame: Frame) -> str:
    """Say in a line where the robot is, how many objects it knows, and what the step took."""
    pose = slam.pose
    place = " ".join(f"{entry:.2f}" for entry in pose[: 2 if len(pose) == 3 else 3])
    return (
        f"step {len(slam)}: at {place} m, {slam.num_objects} objects, {frame.milliseconds:.2f} ms"
    )
