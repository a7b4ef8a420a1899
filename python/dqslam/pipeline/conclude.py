"""The end of every run: what can be said about an estimate, once there is one."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.association import CHI2_GATE, FINAL, RepeatedNoise
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.calibration import CalibrationFinding, ClockError
from dqslam.estimate import Estimate
from dqslam.evaluation import trajectory_error
from dqslam.graph import Graph
from dqslam.io import Trajectory
from dqslam.pipeline.hold_out import describe_overlap, overlap_with_map
from dqslam.pipeline.lens import detections_with_exact_boxes
from dqslam.pipeline.options import RunOptions
from dqslam.pipeline.placement_report import warn_of_placements
from dqslam.pipeline.plausibility import find_doubtful
from dqslam.pipeline.report import (
    box_chi2,
    describe_box_noise,
    describe_boxes,
    describe_calibration,
    describe_clock,
    describe_objects,
    describe_size_prior,
    describe_solver,
    describe_times,
    warn_of_bent_poses,
    warn_of_boxes,
    warn_of_calibration,
    warn_of_contradictions,
    warn_of_doubtful,
    warn_of_evidence,
)
from dqslam.pipeline.report_tracks import describe_tracks
from dqslam.pipeline.shape_choice import warn_of_shapes
from dqslam.recording import Detections
from dqslam.tracks import Tracked
from dqslam.uncertainty import Marginals

CLOCK = "clock:"  #: how a doubt about clocks begins
# The score of a delay tells less than a search has found, and says another number.
DELAY = "time_offset"


@dataclass(frozen=True, eq=False)
class EstimatorOutput:
    """What an estimator answers: an estimate, how it was reached, and what was learned on the way.

    Boxes are those that it was given.
    """

    estimate: Estimate
    marginals: Marginals | None
    """None without objects, as is the summary."""
    summary: _core.Summary | None
    object_id: Ints
    """The object that each box shows, -1 for none, shape (m,)."""
    keyframes: int
    """Poses whose boxes took part."""
    size_prior: SizePrior | SizePriors
    box_noise: BoxNoise
    """What was believed in the end."""
    odometry_noise: OdometryNoise | None
    """Root mean square of a step, where it was estimated."""
    object_noise: tuple[BoxNoise, ...] = ()
    """Of the boxes of each mapped object, where it was estimated."""
    repeated: RepeatedNoise | None = None
    """What of the boxes' noise repeats from image to image, where that was estimated."""
    shapes: dict[str, Any] | None = None
    """Which objects are cuboids or cylinders, and why others are not, where that was asked."""
    placements: dict[str, Any] | None = None
    """Planes that objects stand on, and which placements hold, where rules were given."""
    evidence: dict[str, Any] | None = None
    """What boxes that took no part say for the estimate, against the odometry."""
    noise_levels: dict[str, float] = field(default_factory=dict)
    """Of its components: meters and radians a step, and shares of length and angle."""
    remarks: tuple[str, ...] = ()
    """What was noticed on the way, a sentence each."""
    calibration: tuple[CalibrationFinding, ...] = ()
    """What the boxes say about camera, mount and odometry, which were taken for known."""
    clock: ClockError | None = None
    """The offset of time with which the map fits the boxes best; None if it was not looked for."""
    hidden: Bools | None = None
    """Edges of each box that a nearer object may hide, shape (m, 4); None where not looked for."""
    estimated: tuple[CalibrationFinding, ...] = ()
    """What was estimated of them, and used."""
    live_poses: Floats | None = None
    """Of a session, before its last polish: world_from_robot, shape (n, d)."""
    tracked: Tracked | None = None
    """What moves; None where no box may show it."""
    step_ms: Floats | None = None
    """Of a session: wall clock of each step, shape (n,)."""
    took_part: Bools | None = None
    """Boxes of the images that were estimated together, shape (m,); None for all boxes."""
    step_covariance: Floats | None = None
    """Covariance of each step, (n - 1, k, k), where it was estimated in more detail than by
    ``odometry_noise``."""


@dataclass(frozen=True, eq=False)
class RunResult:
    """An estimate of a recording, what it was made from, and its report."""

    estimate: Estimate
    detections: Detections
    """All boxes, with the ids of the objects that they show, -1 for none. Edges that a nearer
    object may hide count as truncated, too."""
    held_out: Bools
    """Which boxes were kept from the estimator, shape (m,)."""
    marginals: Marginals | None
    """Covariances of the poses, NaN between keyframes, and of the mapped objects; None without
    objects."""
    summary: _core.Summary | None
    """How the solver got there; None without objects."""
    report: dict[str, Any]
    """What report.json holds, in units that its keys name."""
    graph: Graph | None = None
    """The problem of the mapped objects' boxes, for a solve together with other recordings; None
    where there is none, see ``kept_problem``."""


def conclude(
    output: EstimatorOutput,
    boxes: Detections,
    held_out: Bools,
    options: RunOptions,
    reference: Trajectory | None,
) -> RunResult:
    """Judge an estimate by all boxes, (m,), those held out too, and by a reference trajectory.

    Boxes with final ids are tested against their object, others against any of their class.
    """
    estimate, noise = output.estimate, output.odometry_noise
    object_id = boxes.object_id.copy()
    object_id[~held_out] = output.object_id
    truncated = boxes.truncated.copy()
    if output.hidden is not None:
        truncated[~held_out] |= output.hidden
    detections = detections_with_exact_boxes(
        estimate.camera,
        estimate.pose_model,
        estimate.poses,
        estimate.object_ids,
        estimate.ellipsoids,
        replace(boxes, object_id=object_id, truncated=truncated),
    )
    doubtful = find_doubtful(estimate, output.size_prior, output.marginals)
    estimate = replace(estimate, doubtful=doubtful)
    assigned = detections.select((object_id >= 0) & ~held_out)
    chi2 = box_chi2(estimate, assigned, output.object_noise or output.box_noise)
    mapped = np.isin(assigned.object_id, estimate.object_ids)
    tests_held_out = bool(held_out.any())
    tested = detections.select(held_out if tests_held_out else ~held_out)
    if options.trust_ids != FINAL:
        tested = replace(tested, object_id=np.full(len(tested), -1))
    overlap, tested_id = overlap_with_map(estimate, tested)
    if tests_held_out:
        object_id[held_out] = tested_id
    doubts = warn_of_boxes(len(output.object_id), int(mapped.sum()))
    clock_is_wrong = output.clock is not None and output.clock.is_sure
    if output.clock is not None and clock_is_wrong:
        doubts.append(f"{CLOCK} {output.clock}")
    report = {
        "warnings": [
            *output.remarks,
            *doubts,
            *warn_of_evidence(output.evidence),
            *warn_of_doubtful(estimate),
            *warn_of_contradictions(estimate),
            *warn_of_shapes(output.shapes),
            *warn_of_placements(output.placements),
            *warn_of_bent_poses(output.marginals),
            *warn_of_calibration(
                one for one in output.calibration if not (clock_is_wrong and one.name == DELAY)
            ),
        ],
        "doubts": doubts,
        "mode": options.mode.name.lower(),
        "poses": len(estimate.timestamps),
        "keyframes": output.keyframes,
        "boxes": describe_boxes(chi2[mapped])
        | {
            "of_dropped_objects": int(np.sum(~mapped)),
            "unassigned": int(np.sum(output.object_id < 0)),
        },
        "objects": describe_objects(estimate, assigned, chi2, output.marginals),
        "shapes": output.shapes,
        "placements": output.placements,
        "dropped_objects": {str(name): why for name, why in estimate.dropped.items()},
        "tracks": describe_tracks(output.tracked, boxes.select(~held_out), estimate.timestamps),
        "size_prior": describe_size_prior(output.size_prior),
        "reprojection": describe_overlap(overlap) | {"held_out": tests_held_out},
        "box_noise": describe_box_noise(output.box_noise, output.repeated),
        "evidence": output.evidence,
        "odometry_noise": {"from": "given"}
        if noise is None
        else {"from": "estimated"} | asdict(noise) | {"levels": output.noise_levels},
        "calibration": [asdict(finding) for finding in output.calibration],
        "clock": None if output.clock is None else describe_clock(output.clock),
        "estimated_calibration": describe_calibration(output.estimated),
        "under_constrained": [str(part) for part in output.marginals.under_constrained]
        if output.marginals
        else [],
        "trajectory_error": None
        if reference is None
        else trajectory_error(estimate, reference, live_poses=output.live_poses),
        "solver": None if output.summary is None else describe_solver(output.summary),
    }
    if output.step_ms is not None:
        report["online"] = describe_times(output.step_ms)
    return RunResult(
        estimate=replace(estimate, inliers=chi2 <= CHI2_GATE[4]),
        detections=replace(detections, object_id=object_id),
        held_out=held_out,
        marginals=output.marginals,
        summary=output.summary,
        report=report,
    )
