"""What moves: taken out of the map where it was believed to rest, and tracked."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.association import FINAL, Association
from dqslam.assumptions import SizePriors
from dqslam.io.results.covariances import motion_of_camera
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.options import RunOptions
from dqslam.pipeline.problem import problem_of
from dqslam.recording import Recording
from dqslam.tracks import PathCovariance, estimate_tracks, find_moving

# Iterations of the estimate of the map that movers have been taken from.
_ITERATIONS = 50


def without_movers(found: Association, options: RunOptions) -> Association:
    """Leave objects out of the map that fit a place at rest, but move as their class does.

    The map is then estimated without them.
    """
    scene, labels = found.scene, found.scene.labels
    takes_part = labels.takes_part[labels.object_rows]
    moving = find_moving(
        scene.recording,
        scene.poses,
        scene.ellipsoids,
        np.where(takes_part, labels.object_rows, -1),
        box_noise=scene.box_noise,
        size_prior=options.size_prior,
    )
    if not moving:
        return found
    labels.left_out = labels.left_out | moving
    scene.estimate(max_iterations=_ITERATIONS)
    scene.estimate_noise()
    named = {int(found.ids[row]): why for row, why in moving.items() if found.ids[row] >= 0}
    return replace(found, left_out=dict(sorted((found.left_out | named).items())))


def with_tracks(
    output: EstimatorOutput, recording: Recording, options: RunOptions
) -> EstimatorOutput:
    """Add the tracks of what moves to an estimate.

    The recording has the boxes that the estimator was given, and the ids that it was given them
    with.
    """
    estimate = output.estimate
    detections = recording.detections
    shown = np.isin(output.object_id, estimate.object_ids)
    if output.hidden is not None:
        detections = replace(detections, truncated=detections.truncated | output.hidden)
    tracked = estimate_tracks(
        replace(recording, detections=detections),
        estimate.poses,
        estimate.ellipsoids,
        np.where(shown, np.searchsorted(estimate.object_ids, output.object_id), -1),
        final=options.trust_ids == FINAL,
        box_noise=output.box_noise,
        size_prior=options.size_prior if isinstance(options.size_prior, SizePriors) else None,
        path_covariance=_path_covariance(output, recording, options),
    )
    return replace(output, estimate=replace(estimate, tracks=tracked.tracks), tracked=tracked)


def _path_covariance(
    output: EstimatorOutput, recording: Recording, options: RunOptions
) -> PathCovariance:
    """Return how the covariance of the cameras at some images is found from the estimate."""
    if options.mode == _core.Mode.MAPPING or not output.estimate.is_ellipsoid.any():
        return lambda images: None
    # Most recordings have nothing that moves: the problem is laid out when it is asked for.
    problem = functools.cache(lambda: problem_of(output, recording))
    solver = options.solve_options()
    motion = motion_of_camera(recording.odometry.pose_model, recording.camera)

    def joint(images: Ints) -> Floats | None:
        graph, state = problem()
        try:
            spread = _core.joint_covariance(graph.core, solver, state, images.tolist(), [])
        except RuntimeError:  # a box is undefined, or the data leave a pose open
            return None
        count = len(images)
        blocks = spread.reshape(count, -1, count, motion.shape[1])
        moved = np.einsum("ab,ibjc,dc->iajd", motion, blocks, motion)
        return np.asarray(moved).reshape(6 * count, 6 * count)

    return joint
