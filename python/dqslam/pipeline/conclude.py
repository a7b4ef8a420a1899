"""What can be said about an estimate of a recording, once there is one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association import CHI2_GATE
from dqslam.assumptions import BoxNoise, OdometryNoise, SizePrior, SizePriors
from dqslam.estimate import Estimate
from dqslam.io import Trajectory
from dqslam.pipeline.hold_out import describe_overlap, overlap_with_map
from dqslam.pipeline.report import (
    box_chi2,
    describe_boxes,
    describe_objects,
    describe_size_prior,
    describe_solver,
    trajectory_error,
)
from dqslam.recording import Detections
from dqslam.uncertainty import Marginals


@dataclass(frozen=True)
class RunResult:
    """An estimate, what it was made from, and its report, ready for JSON."""

    estimate: Estimate
    detections: Detections
    """All boxes, with the ids of the objects that they show; -1 for none."""
    held_out: NDArray[np.bool_]
    """Which boxes were kept from the estimator, shape (m,)."""
    marginals: Marginals | None
    """Covariances of the poses, NaN between keyframes, and of the mapped objects; None without
    objects."""
    summary: _core.Summary | None
    """How the solver got there; None without objects."""
    report: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Outcome:
    """An estimate, how it was reached, and what was assumed."""

    estimate: Estimate
    marginals: Marginals | None
    summary: _core.Summary | None
    mode: _core.Mode
    keyframes: int
    """Poses whose boxes took part."""
    box_noise: BoxNoise
    size_prior: SizePrior | SizePriors
    odometry_noise: OdometryNoise | None
    """Of a step, where it was estimated."""


def conclude(
    outcome: Outcome,
    detections: Detections,
    held_out: NDArray[np.bool_],
    *,
    ids_are_final: bool,
    reference: Trajectory | None,
) -> RunResult:
    """Judge an outcome by its boxes, those held out too, and by a reference trajectory.

    ``detections`` are all boxes, with the objects that those not ``held_out`` (m,) show, -1 for
    none. Boxes with final ids are tested against their object, others against any of their class.
    """
    estimate = outcome.estimate
    object_id = detections.object_id.copy()
    assigned = detections.select((object_id >= 0) & ~held_out)
    chi2 = box_chi2(estimate, assigned, outcome.box_noise)
    mapped = np.isin(assigned.object_id, estimate.object_ids)
    tests_held_out = bool(held_out.any())
    tested = detections.select(held_out if tests_held_out else ~held_out)
    if not ids_are_final:
        tested = replace(tested, object_id=np.full(len(tested), -1))
    overlap, tested_id = overlap_with_map(estimate, tested)
    object_id[held_out] = tested_id if tests_held_out else -1
    report = {
        "mode": outcome.mode.name.lower(),
        "poses": len(estimate.timestamps),
        "keyframes": outcome.keyframes,
        "boxes": describe_boxes(chi2[mapped])
        | {
            "of_dropped_objects": int(np.sum(~mapped)),
            "unassigned": int(np.sum(detections.object_id[~held_out] < 0)),
        },
        "objects": describe_objects(estimate, assigned, chi2),
        "dropped_objects": {str(name): why for name, why in estimate.dropped.items()},
        "size_prior": describe_size_prior(outcome.size_prior),
        "reprojection": describe_overlap(overlap) | {"held_out": tests_held_out},
        "box_noise": {"pixels": outcome.box_noise.pixels, "relative": outcome.box_noise.relative},
        "odometry_noise": _describe_noise(outcome.odometry_noise),
        "under_constrained": [str(part) for part in outcome.marginals.under_constrained]
        if outcome.marginals
        else [],
        "trajectory_error": None if reference is None else trajectory_error(estimate, reference),
        "solver": None if outcome.summary is None else describe_solver(outcome.summary),
    }
    return RunResult(
        estimate=replace(estimate, inliers=chi2 <= CHI2_GATE[4]),
        detections=replace(detections, object_id=object_id),
        held_out=held_out,
        marginals=outcome.marginals,
        summary=outcome.summary,
        report=report,
    )


def _describe_noise(estimated: OdometryNoise | None) -> dict[str, Any]:
    if estimated is None:
        return {"from": "given"}
    return {
        "from": "estimated",
        "translation_m": estimated.translation_m,
        "rotation_rad": estimated.rotation_rad,
    }
