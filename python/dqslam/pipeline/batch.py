"""A recording estimated at once: association, a polish, and the poses between the keyframes."""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association import (
    FINAL,
    Association,
    FinalEstimate,
    associate,
    estimate_all_images,
    fill_in,
)
from dqslam.association.noise import StepNoise
from dqslam.calibration import CalibrationFinding, check_calibration
from dqslam.estimate import Estimate
from dqslam.graph import Graph, solve
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.lens import with_exact_boxes
from dqslam.pipeline.moving import without_movers
from dqslam.pipeline.options import Progress, RunOptions
from dqslam.pipeline.report import describe_evidence
from dqslam.recording import Recording
from dqslam.uncertainty import (
    Marginals,
    UnderConstrained,
    marginal_covariances,
    with_contradictions,
)

# Boxes are undistorted again for the map until they move by less than this [px], or so many times.
_LENS_PX = 0.02
_LENS_ROUNDS = 4
# With fewer images to a keyframe, the others have little to add to what the keyframes tell. Without
# final ids, the association believed a noise of boxes that has a lower limit and may be far too
# high: then fewer are worth their time.
FEWEST_IMAGES_A_KEYFRAME, FEWEST_WITHOUT_IDS = 3.0, 1.25


def estimate_batch(
    recording: Recording, options: RunOptions, progress: Progress
) -> EstimatorOutput:
    """Find out which boxes show the same object, and estimate all of it together.

    Edges that a nearer object may hide bound the object from one side only.
    """
    found = associate(
        recording,
        trust=options.trust_ids,
        mode=options.mode,
        box_noise=options.box_noise,
        size_prior=options.size_prior,
        estimates_noise=options.estimates_noise,
        progress=lambda share: progress(share, ""),
    )
    found = without_movers(found, options)
    seen = recording.detections
    detections = replace(seen, truncated=seen.truncated | found.hidden)
    recording = replace(recording, detections=detections)
    solver = options.solve_options()
    solver.schedule = _core.Schedule.BATCH
    estimate, marginals, summary, findings, final = _finish(recording, found, solver, options)
    tells_noise = options.estimates_noise and options.mode != _core.Mode.MAPPING
    scene = found.scene
    if final is not None and scene.step_noise is not None:
        scene.levels = final.levels
    return EstimatorOutput(
        estimate,
        marginals,
        summary,
        object_id=found.object_id,
        hidden=found.hidden,
        keyframes=len(found.keyframes if final is None else final.images),
        size_prior=scene.size_prior,
        box_noise=scene.box_noise if final is None else final.noise.total,
        odometry_noise=scene.odometry_noise if tells_noise else None,
        noise_levels=scene.noise_levels,
        object_noise=() if final is None else final.object_noise,
        repeated=None if final is None else final.noise,
        evidence=None if final is None else describe_evidence(final, estimate.initial_poses),
        remarks=found.remarks,
        calibration=findings,
        took_part=np.isin(seen.pose, found.keyframes if final is None else final.images)
        & ~found.repeats,
        step_covariance=_step_covariance(recording, found) if tells_noise else None,
    )


def _finish(
    recording: Recording, found: Association, solver: _core.SolveOptions, options: RunOptions
) -> tuple[
    Estimate,
    Marginals | None,
    _core.Summary | None,
    tuple[CalibrationFinding, ...],
    FinalEstimate | None,
]:
    """Polish what the association ends with, and use all images, not only keyframes.

    Tests the calibration, too, unless the poses are given.
    """
    odometry = recording.odometry
    path = _core.dead_reckon(odometry.pose_model, odometry.first_pose, odometry.relative)
    graph = found.scene.graph()
    if graph is None:
        return _nothing(recording, path, found.dropped), None, None, (), None
    graph, solved, summary = _solve_exactly(
        recording.camera, graph, found.scene.state(graph), solver
    )
    ids = found.object_ids[solved.object_ids]
    order = np.argsort(ids)
    order = order[ids[order] >= 0]  # those without a box, now that all images are seen, are gone
    dropped = {
        int(found.object_ids[row]): why for row, why in solved.dropped.items()
    } | found.dropped
    dropped.pop(-1, None)
    nothing = _nothing(recording, path, dropped)
    if not order.size:
        return nothing, None, None, (), None
    marginals = marginal_covariances(graph, solved, solver)
    counted = found.object_id[~found.repeats]
    boxes = dict(zip(*np.unique(counted, return_counts=True), strict=True))
    estimate = replace(
        nothing,
        poses=fill_in(recording, found.keyframes, solved.poses),
        object_ids=ids[order],
        class_names=tuple(solved.class_names[row] for row in order),
        observations=np.array([boxes[name] for name in ids[order]], dtype=np.int64),
        dual_quadrics=solved.dual_quadrics[order],
        ellipsoids=solved.ellipsoids[order],
        contradicted={
            int(found.object_ids[row]): why
            for row, why in solved.contradicted.items()
            if found.object_ids[row] in ids[order]
        },
    )
    poses = np.full((len(path), *marginals.poses.shape[1:]), np.nan)
    poses[found.keyframes] = marginals.poses
    marginals = replace(
        marginals,
        poses=poses,
        objects=marginals.objects[order],
        under_constrained=tuple(_named(part, found) for part in marginals.under_constrained),
    )
    final = None
    if solver.mode == _core.Mode.SLAM and options.box_noise is None:
        final = _use_all_images(recording, found, solved.poses, estimate, options.trust_ids)
    if final is not None:
        estimate = replace(
            estimate,
            poses=final.poses,
            ellipsoids=final.ellipsoids,
            dual_quadrics=np.array(
                [_core.dual_quadric_from_ellipsoid(e) for e in final.ellipsoids]
            ),
        )
        poses[:] = np.nan
        poses[final.images] = final.pose_covariance
        marginals = replace(
            marginals, poses=poses, objects=with_contradictions(final.object_covariance, estimate)
        )
    findings: tuple[CalibrationFinding, ...] = ()
    if solver.mode == _core.Mode.SLAM:
        # Where an object reaches the camera, a box next to the estimate's is undefined: no test.
        with contextlib.suppress(RuntimeError, ValueError):
            findings = check_calibration(graph, solved, solver)
    return estimate, marginals, summary, findings, final


def _step_covariance(recording: Recording, found: Association) -> NDArray[np.float64] | None:
    """Return the covariance of each step that is believed in the end, (n - 1, k, k).

    None where it was not estimated.
    """
    scene, count = found.scene, len(recording.timestamps)
    if scene.step_noise is None or not len(scene.inflation):
        return None
    every = np.arange(count)
    steps = StepNoise.between(recording, every)
    motion = np.searchsorted(found.keyframes, every[:-1], side="right") - 1
    inflation = scene.inflation[motion.clip(0, len(scene.inflation) - 1)]
    return steps.covariance(scene.levels, inflation)


def _use_all_images(
    recording: Recording,
    found: Association,
    poses: NDArray[np.float64],
    estimate: Estimate,
    trust: float,
) -> FinalEstimate | None:
    """Estimate by all images, from the poses of keyframes (f, d) and the objects of an estimate.

    None where that has little to add, and where boxes come through a lens: these are exact only in
    the problem of the keyframes.
    """
    object_id = np.where(found.repeats, -1, found.object_id)
    images = np.unique(recording.detections.pose[object_id >= 0])
    fewest = FEWEST_IMAGES_A_KEYFRAME if trust == FINAL else FEWEST_WITHOUT_IDS
    if len(images) < fewest * len(found.keyframes) or recording.camera.has_distortion:
        return None
    place = np.searchsorted(estimate.object_ids, object_id)
    place = place.clip(max=len(estimate.object_ids) - 1)
    mapped = estimate.object_ids[place] == object_id
    return estimate_all_images(
        recording,
        found.scene,
        found.keyframes,
        np.where(mapped, place, -1),
        poses,
        estimate.ellipsoids,
    )


def _solve_exactly(
    camera: _core.Camera, graph: Graph, start: _core.State, options: _core.SolveOptions
) -> tuple[Graph, Estimate, _core.Summary]:
    """Solve with boxes that are undistorted for the objects of the map, which they change a little.

    Returns the problem with these boxes, too. Without distortion this is one solve.
    """
    boxes, state = graph.core.boxes.box, start
    for _ in range(_LENS_ROUNDS):
        before = graph.core.boxes.box
        if camera.has_distortion:
            core = with_exact_boxes(graph.core, camera, boxes, state)
            graph = replace(graph, core=core)
        solved, summary = solve(graph, options, start=state)
        if np.abs(graph.core.boxes.box - before).max(initial=0.0) < _LENS_PX:
            break
        landmarks = state.landmarks.copy()
        landmarks[np.isin(graph.object_ids, solved.object_ids)] = solved.ellipsoids
        state = _core.State(solved.poses, landmarks)
    return graph, solved, summary


def _named(part: UnderConstrained, found: Association) -> UnderConstrained:
    """Name a pose by its row in the recording and an object by its id, not as in the solve."""
    names = found.keyframes if part.kind == "pose" else found.object_ids
    return replace(part, name=int(names[part.name]))


def _nothing(recording: Recording, path: NDArray[np.float64], dropped: dict[int, str]) -> Estimate:
    """Return the odometry as it is, and a map without objects."""
    return Estimate(
        pose_model=recording.odometry.pose_model,
        camera=recording.camera,
        timestamps=recording.timestamps,
        poses=path,
        initial_poses=path,
        object_ids=np.zeros(0, dtype=np.int64),
        class_names=(),
        observations=np.zeros(0, dtype=np.int64),
        dual_quadrics=np.zeros((0, 9)),
        ellipsoids=np.zeros((0, 9)),
        dropped=dict(sorted(dropped.items())),
    )
