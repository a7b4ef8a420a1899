"""Rules of where objects are, in the last estimate of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.estimate import Estimate
from dqslam.metrics import up_direction
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.options import RunOptions
from dqslam.pipeline.placement_report import describe_placements
from dqslam.pipeline.problem import problem_of
from dqslam.placements import solve_with_placements
from dqslam.recording import Recording
from dqslam.subgraph import rebuilt
from dqslam.uncertainty import marginal_covariances

# The cameras' own direction is known to some 20 degrees only: z is believed if it is within 45.
Z_IS_UP = 0.7


def with_placements(
    output: EstimatorOutput, recording: Recording, options: RunOptions
) -> EstimatorOutput:
    """Return the estimate with the rules of the options, which are found in it and solved with it.

    The poses and the covariances stay as they are if poses were given, or were estimated with the
    parts of the noise that repeat, through a lens, or with absolute positions. The covariances are
    then those without the rules, which are larger.
    """
    rules, before = options.placements, output.estimate
    if rules is None or not len(before.object_ids) or np.isnan(before.ellipsoids).any():
        return output
    up = _up(before) if rules.up is None else rules.up
    rules = replace(rules, up=up)
    graph, state = problem_of(output, recording)
    rows = np.searchsorted(before.object_ids, graph.object_ids)
    if before.object_shapes:
        shapes = [before.object_shapes[row] for row in rows]
        graph = replace(graph, core=rebuilt(graph.core, shapes=shapes))
        state = _core.State(state.poses, before.landmarks[rows], shapes)
    solver = options.solve_options()
    solver.schedule = _core.Schedule.BATCH
    poses_stay = (
        options.mode == _core.Mode.MAPPING
        or output.repeated is not None
        or recording.absolute is not None
        or recording.camera.has_distortion
    )
    if poses_stay:
        solver.mode = _core.Mode.MAPPING
        graph = replace(graph, core=rebuilt(graph.core, initial_poses=state.poses))
    placed, found, summary, placements = solve_with_placements(graph, rules, solver, start=state)
    rows = np.searchsorted(before.object_ids, found.object_ids)
    landmarks = before.landmarks if len(before.landmarks) else before.ellipsoids
    estimate = replace(
        before,
        poses=found.poses,
        ellipsoids=_with_rows(before.ellipsoids, rows, found.ellipsoids),
        dual_quadrics=_with_rows(before.dual_quadrics, rows, found.dual_quadrics),
        landmarks=_with_rows(landmarks, rows, found.landmarks),
    )
    marginals = output.marginals
    if marginals is not None and not poses_stay:
        known = marginal_covariances(placed, found, solver)
        marginals = replace(known, objects=_with_rows(marginals.objects, rows, known.objects))
    return replace(
        output,
        estimate=estimate,
        marginals=marginals,
        summary=output.summary if poses_stay else summary,
        placements=describe_placements(placements, found) | {"up": list(up)},
    )


def _with_rows(values: Floats, rows: Ints, changed: Floats) -> Floats:
    values = values.copy()
    values[rows] = changed
    return values


def _up(estimate: Estimate) -> tuple[float, float, float]:
    """Return z, or where the cameras are held in another way, as in a camera's frame, their up."""
    if estimate.pose_model == _core.PoseModel.SE2:
        return 0.0, 0.0, 1.0
    cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, estimate.poses)
    x, y, z = up_direction(cameras).tolist()
    return (0.0, 0.0, 1.0) if z > Z_IS_UP else (x, y, z)
