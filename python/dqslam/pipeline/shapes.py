"""Cuboids and cylinders in the map of a run, where their boxes show them.

The estimate with ellipsoids comes first. `choose_shapes` decides at its poses, and the objects that
are no ellipsoids are then estimated once more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._core import Shape
from dqslam.assumptions import BoxNoise
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.layout import shapes_of
from dqslam.metrics import up_direction
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.options import RunOptions
from dqslam.pipeline.problem import problem_of
from dqslam.pipeline.shape_choice import FEWEST_BOXES, choose_shapes, describe_shapes
from dqslam.recording import Recording
from dqslam.solids import box_chi_squares
from dqslam.subgraph import rebuilt
from dqslam.uncertainty import Marginals, marginal_covariances

# With more poses, those of the estimate with ellipsoids stay.
MOST_POSES = 2000
PARAMETERS = 9
USUAL_CHI2 = 3.36  # the median with 4 degrees of freedom
LEAST_SHARE = 0.01


def with_shapes(
    output: EstimatorOutput, recording: Recording, options: RunOptions
) -> EstimatorOutput:
    """Return the estimate with cuboids and cylinders where the boxes show them.

    Where none is found, the estimate is as it was. Else it is solved once more with the shapes. The
    poses stay as they are if they were estimated with the parts of the noise that repeat, through a
    lens, with absolute positions, or if there are very many.
    """
    wanted = options.shapes
    if wanted in (None, Shape.ELLIPSOID) or not output.estimate.is_ellipsoid.any():
        return output
    if np.isnan(output.estimate.ellipsoids).any():
        return output
    graph, state = problem_of(output, recording)
    up = _up(output.estimate)
    core = rebuilt(graph.core, scene_priors=_core.ScenePriors(up=up))
    told = shapes_of(wanted, graph.class_names, recording.detections)
    solver = options.solve_options()
    solver.schedule = _core.Schedule.BATCH
    solver.mode = _core.Mode.MAPPING
    choice = choose_shapes(replace(graph, core=core), state, told, solver)
    if not choice.is_body.any():
        return replace(output, shapes=describe_shapes(choice))
    chosen = replace(graph, core=rebuilt(core, shapes=list(choice.shapes)))
    report = describe_shapes(choice)
    moved = _with_poses(output, recording, options, chosen, state)
    if moved is not None:
        return replace(moved, shapes=report)
    at_poses = replace(chosen, core=rebuilt(chosen.core, initial_poses=state.poses))
    found, _ = solve(at_poses, solver, start=state)
    return replace(
        output,
        estimate=_merged(output.estimate, found, found.is_body),
        marginals=_at_known_poses(output, at_poses, found, state, solver),
        shapes=report,
    )


def _with_poses(
    output: EstimatorOutput,
    recording: Recording,
    options: RunOptions,
    graph: Graph,
    state: _core.State,
) -> EstimatorOutput | None:
    """Return the estimate of poses and objects in their shapes; None if the poses are to stay."""
    if (
        options.mode == _core.Mode.MAPPING
        or output.repeated is not None
        or recording.absolute is not None
        or recording.camera.has_distortion
        or len(state.poses) > MOST_POSES
    ):
        return None
    solver = options.solve_options()
    solver.schedule = _core.Schedule.BATCH
    found, summary = solve(graph, solver, start=state)
    if found.dropped:
        return None
    noise: dict[int, BoxNoise] = {}
    if options.box_noise is None:
        graph, noise = _with_noise_of_bodies(graph, found, output.box_noise)
        start = _core.State(found.poses, found.landmarks, list(found.object_shapes))
        found, summary = solve(graph, solver, start=start)
        if found.dropped:
            return None
    every = np.ones(len(found.object_ids), dtype=np.bool_)
    estimate = replace(_merged(output.estimate, found, every), poses=found.poses)
    found_marginals = marginal_covariances(graph, found, solver)
    marginals = output.marginals
    if marginals is not None:
        objects = marginals.objects.copy()
        objects[np.searchsorted(estimate.object_ids, found.object_ids)] = found_marginals.objects
        marginals = replace(found_marginals, objects=objects)
    return replace(
        output,
        estimate=estimate,
        marginals=marginals,
        summary=summary,
        object_noise=tuple(
            noise.get(one, output.box_noise) for one in estimate.object_ids.tolist()
        ),
    )


def _with_noise_of_bodies(
    graph: Graph, found: Estimate, believed: BoxNoise
) -> tuple[Graph, dict[int, BoxNoise]]:
    """Return the problem with the noise of boxes that the misfits of bodies show, and it by id.

    What was believed has to allow for ellipsoids, whose boxes are off by several percent of their
    sides. It only becomes smaller, by one factor for each object.
    """
    core, boxes = graph.core, graph.core.boxes
    chi2 = box_chi_squares(
        core.pose_model,
        core.camera,
        found.poses[boxes.pose],
        found.solids.take(boxes.object),
        boxes.box,
        boxes.covariance,
        boxes.truncated,
    )
    shares = np.ones(len(found.object_ids))
    for row in np.flatnonzero(found.is_body).tolist():
        own = (boxes.object == row) & ~boxes.truncated.any(axis=1)
        freedom = 1.0 - PARAMETERS / (4.0 * max(int(own.sum()), 1))
        if own.sum() >= FEWEST_BOXES:
            usual = USUAL_CHI2 * freedom
            shares[row] = np.clip(np.median(chi2[own]) / usual, LEAST_SHARE, 1.0)
    changed = _core.BoxTable(
        pose=boxes.pose,
        object=boxes.object,
        box=boxes.box,
        covariance=boxes.covariance * shares[boxes.object][:, None],
        truncated=boxes.truncated,
    )
    noise = {
        int(found.object_ids[row]): BoxNoise(
            believed.pixels * np.sqrt(shares[row]), believed.relative * np.sqrt(shares[row])
        )
        for row in range(len(shares))
    }
    return replace(graph, core=rebuilt(core, boxes=changed)), noise


def _at_known_poses(
    output: EstimatorOutput,
    graph: Graph,
    found: Estimate,
    state: _core.State,
    solver: _core.SolveOptions,
) -> Marginals | None:
    """Return covariances with those of bodies that were fitted at known poses.

    These know neither of the poses' errors nor of what repeats from box to box. Their centers
    therefore have the covariance of the ellipsoid, and their shapes grow by the ratio of its log
    volume's variances.
    """
    marginals = output.marginals
    if marginals is None:
        return None
    fitted = marginal_covariances(graph, found, solver)
    plain = replace(graph, core=rebuilt(graph.core, shapes=[]))
    ellipsoids = replace(
        found,
        object_shapes=(),
        ellipsoids=state.landmarks[np.isin(graph.object_ids, found.object_ids)],
    )
    known = marginal_covariances(plain, ellipsoids, solver)
    objects = marginals.objects.copy()
    for own in np.flatnonzero(found.is_body).tolist():
        row = int(np.searchsorted(output.estimate.object_ids, found.object_ids[own]))
        before, without = (
            _log_volume_variance(ellipsoids.ellipsoids[own], covariance)
            for covariance in (marginals.objects[row], known.objects[own])
        )
        covariance = fitted.objects[own] * max(1.0, before / without)
        covariance[:3, 3:], covariance[3:, :3] = 0.0, 0.0
        covariance[:3, :3] = marginals.objects[row][:3, :3]
        objects[row] = covariance
    return replace(marginals, objects=objects)


def _log_volume_variance(ellipsoid: Floats, covariance: Floats) -> float:
    jacobian = _core.log_semi_axes_jacobian(ellipsoid).sum(axis=0)
    return float(jacobian @ covariance @ jacobian)


def _up(estimate: Estimate) -> Floats:
    """Return the direction (3,) in which objects stand."""
    if estimate.pose_model == _core.PoseModel.SE2:
        return np.array([0.0, 0.0, 1.0])
    cameras = _core.world_from_camera(estimate.pose_model, estimate.camera, estimate.poses)
    return up_direction(cameras)


def _merged(estimate: Estimate, found: Estimate, replaced: Bools) -> Estimate:
    """Return an estimate with the objects of another, those of the flags (f,), in their shapes."""
    count = len(estimate.object_ids)
    shapes = [Shape.ELLIPSOID] * count
    ellipsoids, quadrics = estimate.ellipsoids.copy(), estimate.dual_quadrics.copy()
    landmarks = ellipsoids.copy()
    rows = np.searchsorted(estimate.object_ids, found.object_ids)
    for row, own in zip(rows.tolist(), range(len(found.object_ids)), strict=True):
        if replaced[own]:
            shapes[row] = found.object_shapes[own] if found.object_shapes else Shape.ELLIPSOID
            ellipsoids[row] = found.ellipsoids[own]
            quadrics[row] = found.dual_quadrics[own]
            landmarks[row] = found.landmarks[own]
    return replace(
        estimate,
        ellipsoids=ellipsoids,
        dual_quadrics=quadrics,
        landmarks=landmarks,
        object_shapes=tuple(shapes),
    )
