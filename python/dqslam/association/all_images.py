"""The last estimate of an association: of all images that have boxes, their errors correlated.

The association takes images from new viewpoints for independent, and leaves out the others. Once
it is known which box shows which object, all images count: what their errors have in common is
estimated, and what they tell beyond that, as how the camera moved between similar views, is used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.association.correlated import CorrelatedProblem
from dqslam.association.noise import StepNoise
from dqslam.association.repetition import RepeatedNoise
from dqslam.association.scene_map import SceneMap
from dqslam.association.thinning import bend_path, thin_recording
from dqslam.association.variances import Levels, estimate_with_levels
from dqslam.graph import Graph, build_graph
from dqslam.recording import Recording

# The correlated problem is dense: so many images at most have all their boxes in it, else the
# keyframes have; and with more keyframes than this, it is left to them to be independent.
MOST_IMAGES, MOST_KEYFRAMES = 200, 400
# Iterations that bring the images between the keyframes to where their boxes fit.
FIRST_ITERATIONS = 30
OTHER_ITERATIONS = 10


@dataclass(frozen=True, eq=False)
class FinalEstimate:
    """Poses and objects by all images, and the noise that explains them."""

    poses: Floats
    """All poses of the recording, shape (n, d)."""
    ellipsoids: Floats
    """Shape (o, 9)."""
    images: Ints
    """Rows of the poses whose boxes were estimated together, ascending."""
    pose_covariance: Floats
    """Of these poses, shape (i, k, k)."""
    object_covariance: Floats
    """Shape (o, 9, 9)."""
    noise: RepeatedNoise
    """Of boxes."""
    levels: Floats
    """Of the odometry's components, empty where its covariance was given."""


def estimate_all_images(
    recording: Recording,
    scene: SceneMap,
    keyframes: Ints,
    object_row: Ints,
    poses: Floats,
    ellipsoids: Floats,
) -> FinalEstimate | None:
    """Estimate the poses of all images with boxes, and the objects, from those of keyframes.

    Parameters
    ----------
    recording
        All of it, with the odometry's covariance as given.
    scene
        The association's map: what it believes of noise and sizes.
    keyframes
        Rows of its poses, ascending, shape (f,).
    object_row
        Object of each box of the recording, by rows of ``ellipsoids``, -1 for none, shape (m,).
    poses, ellipsoids
        Where the estimate starts: of keyframes, (f, d), and objects, (o, 9), each with a box.

    Returns
    -------
    The estimate; None where there are too many images, or an object reaches a camera.
    """
    detections, model = recording.detections, recording.odometry.pose_model
    images = np.union1d(keyframes[:1], detections.pose[object_row >= 0])
    if len(images) > MOST_IMAGES:
        images = keyframes
    if not 2 <= len(images) <= MOST_KEYFRAMES:
        return None
    path = _core.dead_reckon(model, recording.odometry.first_pose, recording.odometry.relative)
    start = bend_path(model, path, keyframes, poses)
    believed = _first_levels(recording, scene, keyframes, images)
    graph = _lay_out(recording, scene, believed, images, object_row, (start, ellipsoids))
    if len(graph.object_ids) < len(ellipsoids):
        return None
    options = _options(FIRST_ITERATIONS)
    solution = _core.solve(graph.core, options, _core.State(start[images], ellipsoids))
    state = _core.State(solution.poses, solution.landmarks)
    problem = CorrelatedProblem(graph.core, knows_size=not scene.learns_size)
    found = estimate_with_levels(problem, state, believed)
    if found is None:
        return None
    covariance = np.linalg.inv(found.hessian)
    k, count = problem.k, len(images)
    covariance = np.pad(covariance, ((k, 0), (k, 0)))  # the first pose is exact
    return FinalEstimate(
        bend_path(model, path, images, found.state.poses),
        np.asarray(found.state.landmarks),
        images,
        _blocks(covariance[: k * count, : k * count], k),
        _blocks(covariance[k * count :, k * count :], 9),
        believed.boxes,
        believed.of_steps,
    )


def _first_levels(
    recording: Recording, scene: SceneMap, keyframes: Ints, images: Ints
) -> Levels:
    """Return what to believe of boxes and of motions between images, to begin with."""
    motions = len(images) - 1
    if scene.step_noise is None:
        return Levels(RepeatedNoise(), None, np.zeros(0), np.ones(motions), np.zeros(0))
    between = np.searchsorted(keyframes, images[:-1], side="right") - 1
    inflation = scene.inflation[between.clip(0, len(scene.inflation) - 1)]
    steps = StepNoise.between(recording, images)
    return Levels(RepeatedNoise(), steps, scene.levels, inflation, scene.lowest_levels)


def _lay_out(
    recording: Recording,
    scene: SceneMap,
    believed: Levels,
    images: Ints,
    object_row: Ints,
    state: tuple[Floats, Floats],
) -> Graph:
    """Make the problem of some images, from a state: poses (n, d) and objects (o, 9).

    Without boxes whose object is not in front of the camera there.
    """
    poses, ellipsoids = state
    detections = recording.detections
    used = np.flatnonzero((object_row >= 0) & np.isin(detections.pose, images))
    _, in_front = _core.project_to_boxes(
        recording.odometry.pose_model,
        recording.camera,
        poses[detections.pose[used]],
        ellipsoids[object_row[used]],
    )
    used = used[in_front]
    boxes = replace(detections.select(used), object_id=object_row[used])
    thin = thin_recording(replace(recording, detections=boxes), images)
    if believed.steps is not None:
        covariance = believed.steps.covariance(believed.of_steps, believed.inflation)
        thin = replace(thin, odometry=replace(thin.odometry, covariance=covariance))
    noise = believed.boxes.total
    return build_graph(thin, box_noise=noise, size_prior=scene.size_prior)


def _options(max_iterations: int) -> _core.SolveOptions:
    """Return the options of an estimate that begins near where it ends."""
    return _core.SolveOptions(
        residual=_core.Residual.BOX,
        schedule=_core.Schedule.BATCH,
        loss=_core.Loss.CAUCHY,
        loss_scale=2.0,
        minimizer=_core.Minimizer.LEVENBERG_MARQUARDT,
        max_iterations=max_iterations,
    )


def _blocks(matrix: Floats, size: int) -> Floats:
    """Return the blocks on the diagonal of a matrix, (n, size, size)."""
    count = len(matrix) // size
    rows = np.arange(count)
    return np.asarray(matrix.reshape(count, size, count, size)[rows, :, rows])
