"""The problem of all poses and mapped objects of an estimate, whose boxes are known by then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Ints
from dqslam.association import RepeatedNoise
from dqslam.graph import Graph, build_graph
from dqslam.layout import flat
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.lens import detections_with_exact_boxes
from dqslam.pipeline.options import RunOptions
from dqslam.recording import Recording
from dqslam.subgraph import rebuilt


def shown_boxes(output: EstimatorOutput) -> Ints:
    """Return the rows of the boxes that show a mapped ellipsoid."""
    estimate = output.estimate
    return np.flatnonzero(np.isin(output.object_id, estimate.object_ids[estimate.is_ellipsoid]))


def problem_of(output: EstimatorOutput, recording: Recording) -> tuple[Graph, _core.State]:
    """Return the problem of an estimate's boxes and the recording's measurements, and its start.

    Noise and sizes are those that the estimate believes. Absolute positions take no part.
    """
    estimate, odometry = output.estimate, recording.odometry
    boxes = replace(recording.detections, object_id=output.object_id).select(shown_boxes(output))
    boxes = detections_with_exact_boxes(
        estimate.camera,
        estimate.pose_model,
        estimate.poses,
        estimate.object_ids,
        estimate.ellipsoids,
        boxes,
    )
    positions = recording.positions
    if positions is not None:
        positions = positions.select(np.isin(positions.object_id, boxes.object_id))
    if output.odometry_noise is not None:
        steps = output.odometry_noise.covariance(len(odometry.relative), odometry.pose_model)
        odometry = replace(odometry, covariance=steps)
    told = replace(
        recording,
        odometry=odometry,
        detections=boxes,
        positions=positions,
        measurements=(),
        absolute=None,
    )
    graph = build_graph(told, box_noise=output.box_noise, size_prior=output.size_prior)
    rows = np.searchsorted(estimate.object_ids, graph.object_ids)
    return graph, _core.State(estimate.poses, estimate.ellipsoids[rows])


def kept_options(options: RunOptions) -> _core.SolveOptions:
    """Return the options with which a kept problem is solved again, from its estimate."""
    solver = options.solve_options()
    solver.schedule = _core.Schedule.BATCH
    return solver


def kept_problem(output: EstimatorOutput, recording: Recording, mode: _core.Mode) -> Graph | None:
    """Return the problem that a result keeps, to be solved together with other recordings.

    There is none without an object, where poses are known, and with absolute positions, which it
    could not have.
    """
    has_positions = recording.absolute is not None and len(recording.absolute) > 0
    if mode == _core.Mode.MAPPING or has_positions:
        return None
    believed = believed_problem(output, recording)
    return None if believed is None else believed[0]


def believed_problem(
    output: EstimatorOutput, recording: Recording
) -> tuple[Graph, _core.State] | None:
    """Return the problem of an estimate with the noise that it believes in the end, and its start.

    It has the boxes that took part in the estimate, as accurate as all boxes of an object are
    together, and the odometry with the covariances that were believed. There is none without an
    object.
    """
    if output.took_part is not None:
        output = replace(output, object_id=np.where(output.took_part, output.object_id, -1))
    if not shown_boxes(output).size:
        return None
    if output.step_covariance is not None:
        odometry = replace(recording.odometry, covariance=output.step_covariance)
        recording = replace(recording, odometry=odometry)
        output = replace(output, odometry_noise=None)
    graph, state = problem_of(output, recording)
    if output.repeated is not None:
        graph = with_repeated_errors(graph, state, output.repeated, output)
    return graph, state


def state_of(output: EstimatorOutput, graph: Graph) -> _core.State:
    """Return the poses and objects of an estimate as a state of its kept problem."""
    estimate = output.estimate
    rows = np.searchsorted(estimate.object_ids, graph.object_ids)
    return _core.State(estimate.poses, estimate.ellipsoids[rows], shared=estimate.shared)


def with_repeated_errors(
    graph: Graph, state: _core.State, noise: RepeatedNoise, output: EstimatorOutput
) -> Graph:
    """Return a problem whose boxes have the variances of ``RepeatedNoise.together``."""
    core, table = graph.core, graph.core.boxes
    cameras = _core.world_from_camera(core.pose_model, core.camera, state.poses)[table.pose]
    covariance = np.zeros((len(table.box), 4, 4))
    for row, object_id in enumerate(graph.object_ids.tolist()):
        own = np.flatnonzero(table.object == row)
        side = np.tile(table.box[own, 2:] - table.box[own, :2], (1, 2))
        variance = noise.together(state.landmarks[row, :3] - cameras[own, :3], side)
        if output.object_noise:
            place = int(np.searchsorted(output.estimate.object_ids, object_id))
            total = output.object_noise[place].covariance(table.box[own])
            usual = noise.total.covariance(table.box[own])
            variance *= np.diagonal(total, axis1=1, axis2=2) / np.diagonal(usual, axis1=1, axis2=2)
        covariance[own] = variance[:, :, None] * np.eye(4)
    boxes = _core.BoxTable(
        pose=table.pose,
        object=table.object,
        box=table.box,
        covariance=flat(covariance),
        truncated=table.truncated,
    )
    return replace(graph, core=rebuilt(core, boxes=boxes))
