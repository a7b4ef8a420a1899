"""An estimate of a recording together with parameters of its calibration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.calibration import (
    CalibrationFinding,
    are_late,
    are_scales,
    calibration_parameters,
    combined,
    parameter_rows,
    recalibrate,
    scores_at,
    sensitivity,
    solve_jointly,
)
from dqslam.calibration.parameters import parameter_units
from dqslam.graph import Graph
from dqslam.lens import camera_with, lens_of
from dqslam.pipeline.conclude import EstimatorOutput
from dqslam.pipeline.measurements import with_measurements
from dqslam.pipeline.options import Progress, RunOptions
from dqslam.pipeline.problem import problem_of, shown_boxes
from dqslam.recording import Recording

Estimator = Callable[[Recording, RunOptions, Progress], EstimatorOutput]

# The recording is estimated anew with the calibration that its boxes show, until this would no
# longer move any parameter by more than a share of its sigma, or so many times. Each time, boxes
# find their objects and noise is estimated again, so that some movement always remains.
SMALL_CHANGE = 0.5
MOST_ROUNDS = 4
# Behind a lens, boxes are undistorted before they are used, with the camera as given.
_INTRINSIC = ("focal_length", "principal_u", "principal_v", "distortion")
# Their values move boxes instead of numbers of the camera or of the odometry.
_OF_BOXES = ("time_offset", "distortion")

_SCALE = "odometry_scale"


def check_estimated(recording: Recording, options: RunOptions) -> None:
    """Refuse unknown names, and parameters that a run cannot estimate, with a ValueError."""
    names = calibration_parameters()
    asked = {names[row] for row in parameter_rows(options.estimate)}
    if asked and options.mode == _core.Mode.MAPPING:
        raise ValueError("estimate: mode MAPPING takes the poses for known")
    of_camera = sorted(asked & set(_INTRINSIC))
    if of_camera and recording.camera.has_distortion:
        raise ValueError(
            f"estimate: {of_camera[0]} of a camera with a distorted lens cannot be estimated: its "
            "boxes are undistorted first"
        )


def estimate_calibrated(
    recording: Recording, options: RunOptions, estimator: Estimator, progress: Progress
) -> tuple[EstimatorOutput, Recording]:
    """Estimate a recording, then its calibration, and again with that until it stands still.

    Returns the estimate, whose covariances allow for the uncertainty of the calibration, and the
    recording as the calibration corrects it: camera, steps of the odometry, and, for an offset of
    time or a distortion, boxes of mapped objects.
    """
    names = calibration_parameters()
    rows = parameter_rows(options.estimate)
    # Where sizes are learned from the recording, a factor common to all of them is open.
    size = names.index("object_size")
    beside = [size] if options.size_prior is None and size not in rows else []
    solver = options.solve_options()
    solver.schedule = _core.Schedule.BATCH
    total = np.zeros(len(names))
    calibrated, settled, is_late = recording, False, None
    for number in range(MOST_ROUNDS):
        output = _estimate(calibrated, options, estimator, _part(progress, number))
        try:
            # Closures are not of the odometry: its scale and its drift are not theirs.
            graph, state = problem_of(output, replace(calibrated, closures=None))
            if is_late is None:
                is_late = are_late(graph, state, solver, rows)
            scores = scores_at(graph, state, solver, rows, is_late=is_late)
            kept = scores.determined(rows, beside)
            change, sigma = _change(graph, state, [*kept, *beside], solver, is_late)
        except (RuntimeError, ValueError) as error:
            why = f"the calibration could not be estimated, and is as given: {error}"
            plain = _estimate(recording, options, estimator, progress) if number else output
            return replace(plain, remarks=(*plain.remarks, why)), recording
        change, sigma = change[: len(kept)], sigma[: len(kept)]
        settled = bool((np.abs(change) <= SMALL_CHANGE * sigma).all())
        if settled:
            break
        total[kept] = combined(total[kept], change, kept)
        calibrated = recalibrated(recording, output, total, is_late)
    remarks = [
        f"the boxes do not determine {names[row]}, which is as given"
        + (": the sizes of objects are not known" if beside and names[row] == _SCALE else "")
        for row in rows
        if row not in kept
    ]
    if not settled:
        remarks.append(
            f"the calibration does not stand still: after {MOST_ROUNDS} rounds it still moves by "
            f"{np.max(np.abs(change) / sigma):.2g} sigmas"
        )
    marginals = output.marginals
    if marginals is not None and recording.absolute is None:
        found = sensitivity(graph, state, [*kept, *beside], total, solver)
        marginals = found.inflated(marginals, output.estimate.object_ids)
    elif marginals is not None:
        remarks.append("covariances in the frame of absolute positions take it for known")
    sigma = np.where(are_scales(kept), 1.0 + total[kept], 1.0) * sigma  # of the values in all
    estimated = tuple(
        CalibrationFinding(names[row], float(total[row]), float(one), parameter_units()[row])
        for row, one in zip(kept, sigma, strict=True)
    )
    output = replace(
        output,
        marginals=marginals,
        estimated=estimated,
        remarks=(*output.remarks, *remarks),
    )
    return output, calibrated


def recalibrated(
    recording: Recording, output: EstimatorOutput, deviations: Floats, is_late: bool
) -> Recording:
    """Return a recording with deviations of its calibration, shape (p,).

    Boxes move as the estimate predicts it where the images are late. Boxes of no mapped object,
    and those that would leave the image, stay.
    """
    shown = shown_boxes(output)
    given = replace(recording, positions=None, measurements=(), absolute=None, closures=None)
    graph, state = problem_of(replace(output, odometry_noise=None), given)
    core = recalibrate(graph.core, state, graph.timestamps, deviations, is_late=is_late)
    camera = core.camera
    if recording.camera.has_distortion:
        mount = camera.robot_from_camera
        camera = camera_with(recording.camera, lens_of(recording.camera), robot_from_camera=mount)
    detections, odometry = recording.detections, recording.odometry
    names = calibration_parameters()
    if any(deviations[names.index(name)] != 0.0 for name in _OF_BOXES):
        box = detections.box.copy()
        moved = box[shown] + core.boxes.box - graph.core.boxes.box
        size = np.array([camera.width, camera.height])
        leaves = np.any((moved[:, 2:] <= -0.5) | (moved[:, :2] >= size - 0.5), axis=1)
        box[shown[~leaves]] = moved[~leaves]
        detections = replace(detections, box=box)
    k = odometry.covariance.shape[1]
    odometry = replace(
        odometry,
        relative=core.odometry.relative,
        covariance=core.odometry.covariance.reshape(-1, k, k),
    )
    return replace(recording, camera=camera, odometry=odometry, detections=detections)


def _estimate(
    recording: Recording, options: RunOptions, estimator: Estimator, progress: Progress
) -> EstimatorOutput:
    bare = replace(recording, positions=None, measurements=(), absolute=None, closures=None)
    return with_measurements(estimator(bare, options, progress), recording, options)


def _change(
    graph: Graph,
    state: _core.State,
    rows: list[int],
    solver: _core.SolveOptions,
    is_late: bool,
) -> tuple[Floats, Floats]:
    """Return how far parameters are from the values in use, and their sigmas, (p,) each."""
    if not rows:
        return np.zeros(0), np.zeros(0)
    _, _, _, found = solve_jointly(graph, rows, solver, state, is_late)
    return np.array([one.value for one in found]), np.array([one.sigma for one in found])


def _part(progress: Progress, number: int) -> Progress:
    return lambda share, text: progress((number + share) / MOST_ROUNDS, text)
