"""The poses between those that were estimated together, from their own boxes.

What repeats in the errors of boxes is known from the images that were estimated together, and is
taken off; what is left is new in each image, and as uncertain as the prediction is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.association.correlated import CorrelatedProblem, Linearization
from dqslam.association.repetition import RepeatedNoise
from dqslam.association.thinning import bend_path, thin_recording
from dqslam.graph import build_graph
from dqslam.recording import Recording
from dqslam.subgraph import rebuilt

MAX_ITERATIONS = 10


def estimate_between(
    recording: Recording,
    object_row: Ints,
    images: Ints,
    path: Floats,
    problem: CorrelatedProblem,
    found: Linearization,
    noise: RepeatedNoise,
) -> Floats:
    """Return all poses (n, d) from those of ``images`` (i,), which stay as they are.

    Parameters
    ----------
    recording
        With the covariance of each step that is believed.
    object_row
        Object of each box, -1 for none, shape (m,).
    path
        Poses to start from, those of ``images`` estimated, shape (n, d).
    problem, found, noise
        What ``images`` were estimated with.
    """
    detections, model = recording.detections, recording.odometry.pose_model
    _, in_front = _core.project_to_boxes(
        model, recording.camera, path[detections.pose], found.state.landmarks[object_row]
    )
    rows = np.flatnonzero((object_row >= 0) & in_front)
    poses = np.union1d(images, detections.pose[rows])
    if len(poses) == len(images):
        return path
    boxes = replace(detections.select(rows), object_id=object_row[rows])
    thin = thin_recording(replace(recording, detections=boxes), poses)
    graph = build_graph(thin)
    cameras = _core.world_from_camera(model, recording.camera, path[detections.pose[rows]])
    error, variance = predict_errors(problem, found, noise, cameras, boxes.box, object_row[rows])
    table = graph.core.boxes
    box = table.box - error
    # Of an object that fits badly, an error may be larger than a small box: it is then unknown.
    unknown = np.flatnonzero((box[:, 2:] <= box[:, :2]).any(axis=1))
    box[unknown] = table.box[unknown]
    variance[unknown] += error[unknown] ** 2
    covariance = (variance[:, :, None] * np.eye(4)).reshape(-1, 16)
    core = rebuilt(
        graph.core,
        boxes=_core.BoxTable(
            pose=table.pose,
            object=table.object,
            box=box,
            covariance=covariance,
            truncated=table.truncated,
        ),
    )
    options = _core.SolveOptions(
        residual=_core.Residual.BOX,
        schedule=_core.Schedule.BATCH,
        loss=_core.Loss.CAUCHY,
        loss_scale=2.0,
        minimizer=_core.Minimizer.LEVENBERG_MARQUARDT,
        max_iterations=MAX_ITERATIONS,
    )
    start = _core.State(path[poses], found.state.landmarks[graph.object_ids])
    solution = _core.solve(core, options, start)
    kept = bend_path(model, solution.poses, np.searchsorted(poses, images), path[images])
    return bend_path(model, path, poses, kept)


def predict_errors(
    problem: CorrelatedProblem,
    found: Linearization,
    noise: RepeatedNoise,
    cameras: Floats,
    box: Floats,
    object_row: Ints,
) -> tuple[Floats, Floats]:
    """Return the errors that boxes (b, 4) should repeat, and the variances of all of their error.

    ``cameras`` are the poses that they were seen from, (b, 7). Pixels and pixels squared, (b, 4).
    """
    model, camera = problem.graph.pose_model, problem.graph.camera
    known = _core.world_from_camera(model, camera, found.state.poses)
    error, variance = np.zeros((2, len(box), 4))
    side = np.tile(box[:, 2:] - box[:, :2], (1, 2)).T
    for number, (boxes, whitener) in enumerate(zip(problem.objects, found.whiteners, strict=True)):
        rows = np.flatnonzero(object_row == number)
        own, center = noise.times(problem.factors[number]), found.state.landmarks[number, :3]
        new, repeated = own.edge_variances(side[:, rows])
        before = np.sqrt(own.edge_variances(boxes.side)[1])
        alike = (
            noise.correlation(center - cameras[rows, :3], center - known[boxes.poses, :3])
            * before[:, None, :]
        )
        white = np.einsum("eij,ej->ei", whitener.precision, found.error[boxes.rows].T)
        error[rows] = (np.sqrt(repeated) * np.einsum("eri,ei->er", alike, white)).T
        explained = np.sum((alike @ whitener.precision) * alike, axis=2)
        variance[rows] = (new + repeated * np.clip(1.0 - explained, 0.0, 1.0)).T
    return error, variance
