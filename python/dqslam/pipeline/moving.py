"""What moves: taken out of the map where it was believed to rest, and tracked."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.association import FINAL, Association
from dqslam.assumptions import BoxNoise, SizePriors
from dqslam.estimate import Estimate
from dqslam.io.results.covariances import motion_of_camera
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.options import RunOptions
from dqslam.pipeline.problem import believed_problem
from dqslam.recording import Recording
from dqslam.tracks import (
    PathCovariance,
    estimate_tracks,
    find_moving,
    of_cameras,
    path_by_odometry,
)

# Iterations of the estimate of the map that movers have been taken from.
_ITERATIONS = 50


def without_movers(found: Association, options: RunOptions) -> Association:
    """Leave objects out of the map that fit a place at rest, but move as their class does.

    The path of a map with a mover at rest makes it rest, and is believed too much. So objects are
    judged by the path of the odometry alone, as uncertain as that is. The map is then estimated
    without those that move.
    """
    scene, labels = found.scene, found.scene.labels
    takes_part = labels.takes_part[labels.object_rows]
    path, covariance = path_by_odometry(scene.recording)
    if scene.mode == _core.Mode.MAPPING:
        path, covariance = scene.poses, lambda images: None
    moving = find_moving(
        scene.recording,
        path,
        scene.ellipsoids,
        np.where(takes_part, labels.object_rows, -1),
        box_noise=scene.box_noise,
        size_prior=options.size_prior,
        path_covariance=covariance,
    )
    if not moving:
        return found
    labels.dropped = labels.dropped | moving
    scene.estimate(max_iterations=_ITERATIONS)
    scene.estimate_noise()
    named = {
        int(found.object_ids[row]): why for row, why in moving.items() if found.object_ids[row] >= 0
    }
    return replace(found, dropped=dict(sorted((found.dropped | named).items())))


def moving_objects(
    estimate: Estimate, recording: Recording, box_noise: BoxNoise, options: RunOptions
) -> dict[int, str]:
    """Return the ids of objects of an estimate that move, and why that is believed.

    The recording has the ids of the objects that its boxes show, and the odometry with the
    covariances that are believed.
    """
    object_id = recording.detections.object_id
    shown = np.isin(object_id, estimate.object_ids)
    path, covariance = path_by_odometry(recording)
    moving = find_moving(
        recording,
        path,
        estimate.ellipsoids,
        np.where(shown, np.searchsorted(estimate.object_ids, object_id), -1),
        box_noise=box_noise,
        size_prior=options.size_prior,
        path_covariance=covariance,
    )
    return {int(estimate.object_ids[row]): why for row, why in moving.items()}


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
    problem = functools.cache(lambda: believed_problem(output, recording))
    solver = options.solve_options()
    motion = motion_of_camera(recording.odometry.pose_model, recording.camera)

    def joint(images: Ints) -> Floats | None:
        laid_out = problem()
        if laid_out is None:
            return None
        graph, state = laid_out
        try:
            spread = _core.joint_covariance(graph.core, solver, state, images.tolist(), [])
        except RuntimeError:  # a box is undefined, or the data leave a pose open
            return None
        return of_cameras(spread, motion)

    return joint
