"""Positions of objects, absolute positions and loop closures, once the objects are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam.absolute import solve_with_absolute_positions
from dqslam.association import FINAL
from dqslam.graph import solve
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.options import RunOptions
from dqslam.pipeline.problem import problem_of
from dqslam.recording import Recording
from dqslam.uncertainty import marginal_covariances


def usable_measurements(
    recording: Recording, options: RunOptions
) -> tuple[Recording, tuple[str, ...]]:
    """Return the recording with the measurements that can take part, and why others cannot."""
    if not _has_any(recording):
        return recording, ()
    reasons: tuple[str, ...] = ()
    if options.mode == _core.Mode.MAPPING and _has_any_of_poses(recording):
        reasons = (
            "absolute positions and loop closures took no part: mode MAPPING takes the poses for "
            "known",
        )
        recording = replace(recording, absolute=None, closures=None)
    positions, ids = recording.positions, recording.detections.object_id
    if positions is None:
        return recording, reasons
    if options.trust_ids != FINAL:
        why = "positions took no part: the ids of boxes must be final, or objects are not known"
        return replace(recording, positions=None), (*reasons, why)
    seen = np.isin(positions.object_id, ids)
    if seen.all():
        return recording, reasons
    name = positions.object_id[np.argmin(seen)]
    why = f"{np.sum(~seen)} positions took no part: object {name} and the like have no box"
    return replace(recording, positions=positions.select(seen)), (*reasons, why)


def with_measurements(
    output: EstimatorOutput, recording: Recording, options: RunOptions
) -> EstimatorOutput:
    """Return the estimate of all poses and mapped objects with the recording's measurements.

    It starts at the estimate without them. With absolute positions it is in their frame. In mode
    MAPPING the poses stay, and positions move objects only.
    """
    if not _has_any(recording):
        return output
    if not len(output.estimate.object_ids):
        message = "no object was found: positions and loop closures took no part"
        return replace(output, remarks=(*output.remarks, message))
    solver = options.solve_options()
    solver.schedule = _core.Schedule.BATCH
    estimate = output.estimate
    graph, start = problem_of(output, recording)
    found, summary = solve(graph, solver, start=start)
    if recording.absolute is not None:
        found, marginals, summary = solve_with_absolute_positions(
            graph, recording.absolute, solver, start=found
        )
    else:
        marginals = marginal_covariances(graph, found, solver)
    in_map = replace(
        found,
        inliers=estimate.inliers,
        dropped=dict(sorted({**estimate.dropped, **found.dropped}.items())),
    )
    return replace(output, estimate=in_map, marginals=marginals, summary=summary, calibration=())


def _has_any(recording: Recording) -> bool:
    positions = recording.positions
    return (positions is not None and len(positions) > 0) or _has_any_of_poses(recording)


def _has_any_of_poses(recording: Recording) -> bool:
    given = (recording.absolute, recording.closures)
    return any(one is not None and len(one) > 0 for one in given)
