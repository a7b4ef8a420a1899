"""Rules of where objects are, in the last estimate of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.assumptions import PlacementRules
from dqslam.estimate import Estimate
from dqslam.graph import Graph
from dqslam.metrics import up_direction
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.options import RunOptions
from dqslam.pipeline.placement_report import describe_placements
from dqslam.pipeline.problem import believed_problem
from dqslam.placements import placed_covariances, solve_with_placements
from dqslam.recording import Recording
from dqslam.solids import project_to_boxes
from dqslam.subgraph import rebuilt

# The cameras' own direction is known to some 20 degrees only: z is believed if it is within 45.
Z_IS_UP = 0.7
HELD_SIGMA = float(np.deg2rad(20.0))


def with_placements(
    output: EstimatorOutput, recording: Recording, options: RunOptions
) -> EstimatorOutput:
    """Return the estimate with the rules of the options, which are found in it and solved with it.

    The poses and the covariances stay as they are if poses were given, or were estimated with the
    parts of the noise that repeat, through a lens, or with absolute positions. The covariances are
    then those without the rules, which are larger. Where up is only known from how the cameras are
    held, it is estimated.
    """
    rules, before = options.placements, output.estimate
    if rules is None or not len(before.object_ids) or np.isnan(before.ellipsoids).any():
        return output
    believed = believed_problem(output, recording)
    if believed is None:
        return output
    rules = _with_up(rules, before)
    graph, state = believed
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
        graph = _as_estimated(graph, state, before)
    placed, found, summary, placements = solve_with_placements(graph, rules, solver, start=state)
    rows = np.searchsorted(before.object_ids, found.object_ids)
    landmarks = before.landmarks if len(before.landmarks) else before.ellipsoids
    estimate = replace(
        before,
        poses=before.poses if poses_stay else found.poses,
        ellipsoids=_with_rows(before.ellipsoids, rows, found.ellipsoids),
        dual_quadrics=_with_rows(before.dual_quadrics, rows, found.dual_quadrics),
        landmarks=_with_rows(landmarks, rows, found.landmarks),
    )
    marginals = output.marginals
    if marginals is not None and not poses_stay:
        known = placed_covariances(placed, found, placements, solver)
        marginals = replace(known, objects=_with_rows(marginals.objects, rows, known.objects))
    return replace(
        output,
        estimate=estimate,
        marginals=marginals,
        summary=output.summary if poses_stay else summary,
        placements=describe_placements(placements, found, rules),
    )


def _as_estimated(graph: Graph, state: _core.State, estimate: Estimate) -> Graph:
    """Return the problem at known poses whose solution without rules is nearly the estimate.

    Its boxes are those of the estimated objects, with the variances of the detected ones. A problem
    of the detected boxes has another solution, as it does not know the errors of the poses and how
    those of boxes repeat, and that would take the place of the estimate, rules or not. A size prior
    is about the mean size of the object itself: it only pulls towards equal sides.
    """
    core, boxes = graph.core, graph.core.boxes
    rows = np.searchsorted(estimate.object_ids, graph.object_ids)
    predicted, in_front = project_to_boxes(
        core.pose_model,
        core.camera,
        state.poses[boxes.pose],
        estimate.solids.take(rows[boxes.object]),
    )
    table = _core.BoxTable(
        pose=boxes.pose,
        object=boxes.object,
        box=np.where(in_front[:, None], predicted, boxes.box),
        covariance=boxes.covariance,
        truncated=boxes.truncated,
    )
    is_body = estimate.is_body[:, None]
    sizes = np.where(is_body, estimate.half_lengths, estimate.semi_axes)[rows]
    prior = _core.SizePriorTable(
        log_mean=np.log(sizes).mean(axis=1), log_sigma=core.size_prior.log_sigma
    )
    changed = rebuilt(
        core,
        initial_poses=state.poses,
        boxes=table,
        size_prior=prior,
        shared_sigma=np.zeros(0),
    )
    return replace(graph, core=changed)


def _with_rows(values: Floats, rows: Ints, changed: Floats) -> Floats:
    values = values.copy()
    values[rows] = changed
    return values


def _with_up(rules: PlacementRules, estimate: Estimate) -> PlacementRules:
    """Return rules that name up: z, or where cameras are held in another way, roughly their up."""
    if rules.up is not None:
        return rules
    x, y, z = 0.0, 0.0, 1.0
    if estimate.pose_model != _core.PoseModel.SE2:
        cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, estimate.poses)
        x, y, z = up_direction(cameras).tolist()
    if z > Z_IS_UP:
        return replace(rules, up=(0.0, 0.0, 1.0))
    sigma = HELD_SIGMA if rules.up_sigma is None else rules.up_sigma
    return replace(rules, up=(x, y, z), up_sigma=sigma)
