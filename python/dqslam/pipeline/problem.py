"""The problem of all poses and mapped objects of an estimate, whose boxes are known by then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Ints
from dqslam.graph import Graph, build_graph
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.lens import detections_with_exact_boxes
from dqslam.recording import Recording


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
