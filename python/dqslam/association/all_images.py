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
from dqslam.association.between import estimate_between
from dqslam.association.correlated import CorrelatedProblem
from dqslam.association.earning import earns_it, gain_over_odometry, map_along_odometry
from dqslam.association.noise import StepNoise
from dqslam.association.repetition import RepeatedNoise
from dqslam.association.scene_map import SceneMap
from dqslam.association.thinning import bend_path, thin_recording
from dqslam.association.variances import Levels, estimate_with_levels
from dqslam.assumptions import BoxNoise
from dqslam.graph import Graph, build_graph
from dqslam.recording import Recording

# The correlated problem is dense: so many images at most have their boxes in it, else the keyframes
# have, or every other of them; with yet more keyframes, they are left to be independent.
MOST_IMAGES = 150
# Where keyframes are left out, an object keeps all of its own if it would have fewer.
ENOUGH_VIEWS = 6
# Iterations that bring the images between the keyframes to where their boxes fit.
FIRST_ITERATIONS = 30


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
    object_noise: tuple[BoxNoise, ...]
    """Of each object's boxes, both parts together, (o,)."""
    levels: Floats
    """Of the odometry's components, empty where its covariance was given."""
    gain: Floats
    """How much better than the odometry the path by other objects explains each, as the logarithm
    of a ratio of likelihoods, (o,); NaN where that is unknown."""
    keeps_odometry: bool
    """Whether the boxes have not earned it: ``poses`` are the odometry, and objects fit that."""


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
    The estimate; None where there are too many images, an object reaches a camera, or its boxes
    leave it open.
    """
    detections, model = recording.detections, recording.odometry.pose_model
    images = _choose_images(keyframes, detections.pose, object_row)
    if len(images) < 2:
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
    problem = CorrelatedProblem(graph.core)
    try:
        found = estimate_with_levels(problem, state, believed)
    except np.linalg.LinAlgError:  # odometry that is exact, to the digits there are
        return None
    if found is None:
        return None
    try:
        covariance = np.asarray(np.linalg.inv(found.hessian), dtype=np.float64)
    except np.linalg.LinAlgError:  # what its boxes say leaves an object open
        return None
    gain = gain_over_odometry(problem, found, believed.boxes)
    ends = found.state
    if not earns_it(gain):
        ends = map_along_odometry(problem, found, believed.boxes) or ends
    everything = bend_path(model, path, images, ends.poses)
    if ends is found.state:
        everything = estimate_between(
            _with_levels(recording, believed),
            object_row,
            images,
            everything,
            problem,
            found,
            believed.boxes,
        )
    k, count = problem.k, len(images)
    covariance = np.asarray(np.pad(covariance, ((k, 0), (k, 0))))  # the first pose is exact
    return FinalEstimate(
        everything,
        np.asarray(ends.landmarks),
        images,
        _blocks(covariance[: k * count, : k * count], k),
        _blocks(covariance[k * count :, k * count :], 9),
        believed.boxes,
        tuple(believed.boxes.times(factors).total for factors in problem.factors),
        believed.of_steps,
        gain,
        keeps_odometry=ends is not found.state,
    )


def _choose_images(keyframes: Ints, pose: Ints, object_row: Ints) -> Ints:
    """Return the poses whose boxes, at poses (m,) and of objects (m,), are estimated together.

    None where there are too many.
    """
    images = np.union1d(keyframes[:1], pose[object_row >= 0])
    if len(images) <= MOST_IMAGES:
        return images
    if len(keyframes) <= MOST_IMAGES:
        return keyframes
    if len(keyframes) > 2 * MOST_IMAGES:
        return keyframes[:0]
    images = keyframes[::2]
    for row in range(int(object_row.max()) + 1):
        own = pose[object_row == row]
        if np.isin(images, own).sum() < ENOUGH_VIEWS:
            images = np.union1d(images, keyframes[np.isin(keyframes, own)])
    return images


def _first_levels(recording: Recording, scene: SceneMap, keyframes: Ints, images: Ints) -> Levels:
    """Return what to believe of boxes and of motions between images, to begin with."""
    motions = len(images) - 1
    if scene.step_noise is None:
        return Levels(RepeatedNoise(), None, np.zeros(0), np.ones(motions), np.zeros(0))
    between = np.searchsorted(keyframes, images[:-1], side="right") - 1
    inflation = scene.inflation[between.clip(0, len(scene.inflation) - 1)]
    steps = StepNoise.between(recording, images)
    return Levels(RepeatedNoise(), steps, scene.levels, inflation, scene.lowest_levels)


def _with_levels(recording: Recording, believed: Levels) -> Recording:
    """Return a recording whose steps have the noise that is believed."""
    if believed.steps is None:
        return recording
    count = len(recording.timestamps)
    steps = StepNoise.between(recording, np.arange(count))
    covariance = steps.covariance(believed.of_steps)
    return replace(recording, odometry=replace(recording.odometry, covariance=covariance))


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
