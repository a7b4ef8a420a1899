"""Estimate a real recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association import FINAL, Association, associate, fill_in
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.evaluation import common_poses
from dqslam.graph import solve
from dqslam.io import Trajectory
from dqslam.pipeline.border import with_cut_edges
from dqslam.pipeline.conclude import Outcome, RunResult, conclude
from dqslam.pipeline.hold_out import choose_held_out
from dqslam.recording import Recording
from dqslam.uncertainty import Marginals, marginal_covariances


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


def run(
    recording: Recording,
    *,
    trust_ids: float = FINAL,
    mode: _core.Mode = _core.Mode.SLAM,
    reference: Trajectory | None = None,
    box_noise: BoxNoise | None = None,
    size_prior: SizePrior | SizePriors | None = None,
    estimates_noise: bool = False,
    hold_out: float = 0.0,
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> RunResult:
    """Estimate poses and objects of a recording, and report.

    Edges of boxes on the border of the image only bound the object from one side. Objects that do
    not fit a world at rest are left out; without any, the odometry is returned as it is.

    Parameters
    ----------
    trust_ids
        The probability that an object id of the recording stays with its object; 1 takes them for
        final. Boxes without an id need less than 1.
    reference
        The trajectory to compare with, before and after; it may be in another world frame.
    mode
        Whether the odometry is improved (SLAM) or taken as the truth (MAPPING).
    box_noise, size_prior
        What to assume; by default ``BoxNoise``, and the size that the objects found have.
    estimates_noise
        Whether the level of the odometry's noise is estimated instead of believed.
    hold_out, seed
        Share of the boxes, chosen at random, that the map is tested on instead.
    progress
        Is told the share of the work that is done.
    """
    if reference is not None:  # before the work: may they be compared?
        common_poses(recording.timestamps, reference)
    noise = box_noise or BoxNoise()
    recording = with_cut_edges(recording)
    detections = recording.detections
    held_out = choose_held_out(len(detections), hold_out, seed=seed)
    if isinstance(size_prior, SizePriors):
        size_prior.check_classes(set(detections.class_names.values()))
    known = replace(recording, detections=detections.select(~held_out))
    found = associate(
        known,
        trust=trust_ids,
        mode=mode,
        box_noise=noise,
        size_prior=size_prior,
        estimates_noise=estimates_noise,
        progress=progress,
    )
    object_id = np.where(held_out, detections.object_id, -1)
    object_id[~held_out] = found.object_id
    estimate, marginals, summary = _finish(known, found, mode)
    outcome = Outcome(
        estimate,
        marginals,
        summary,
        mode=mode,
        keyframes=len(found.keyframes),
        box_noise=noise,
        size_prior=found.scene.size_prior,
        odometry_noise=(
            found.scene.odometry_noise if estimates_noise and mode != _core.Mode.MAPPING else None
        ),
    )
    return conclude(
        outcome,
        replace(detections, object_id=object_id),
        held_out,
        ids_are_final=trust_ids == FINAL,
        reference=reference,
    )


def _finish(
    recording: Recording, found: Association, mode: _core.Mode
) -> tuple[Estimate, Marginals | None, _core.Summary | None]:
    """Polish what the association ends with, and fill in the poses between the keyframes."""
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    graph = found.scene.graph()
    if graph is None:
        return _nothing(recording, path, found.left_out), None, None
    options = _core.SolveOptions(
        mode=mode, schedule=_core.Schedule.BATCH, loss=_core.Loss.CAUCHY, loss_scale=2.0
    )
    solved, summary = solve(graph, options, start=found.scene.state(graph))
    ids = found.ids[solved.object_ids]
    order = np.argsort(ids)
    order = order[ids[order] >= 0]  # those without a box, now that all images are seen, are gone
    dropped = {int(found.ids[row]): why for row, why in solved.dropped.items()} | found.left_out
    dropped.pop(-1, None)
    if not order.size:
        return _nothing(recording, path, dropped), None, None
    marginals = marginal_covariances(graph, solved, options)
    boxes = dict(zip(*np.unique(found.object_id, return_counts=True), strict=True))
    estimate = replace(
        solved,
        timestamps=recording.timestamps,
        poses=fill_in(recording, found.keyframes, solved.poses),
        initial_poses=path,
        object_ids=ids[order],
        class_names=tuple(solved.class_names[row] for row in order),
        observations=np.array([boxes[name] for name in ids[order]], dtype=np.int64),
        dual_quadrics=solved.dual_quadrics[order],
        ellipsoids=solved.ellipsoids[order],
        dropped=dict(sorted(dropped.items())),
    )
    poses = np.full((len(path), *marginals.poses.shape[1:]), np.nan)
    poses[found.keyframes] = marginals.poses
    marginals = replace(
        marginals,
        poses=poses,
        objects=marginals.objects[order],
        under_constrained=tuple(_named(text, found) for text in marginals.under_constrained),
    )
    return estimate, marginals, summary


def _named(sentence: str, found: Association) -> str:
    """Name a pose by its row in the recording and an object by its id, not as in the solve."""
    kind, row, what = sentence.split(" ", 2)  # "object 3: parameter 0 is ..."
    names = found.keyframes if kind == "pose" else found.ids
    return f"{kind} {names[int(row.rstrip(':'))]}: {what}"


def _nothing(recording: Recording, path: NDArray[np.float64], dropped: dict[int, str]) -> Estimate:
    """Return the odometry as it is, and a map without objects."""
    return Estimate(
        pose_model=recording.odometry.pose_model,
        camera=recording.camera,
        timestamps=recording.timestamps,
        poses=path,
        initial_poses=path,
        object_ids=np.zeros(0, dtype=np.int64),
        class_names=(),
        observations=np.zeros(0, dtype=np.int64),
        dual_quadrics=np.zeros((0, 9)),
        ellipsoids=np.zeros((0, 9)),
        dropped=dict(sorted(dropped.items())),
    )
