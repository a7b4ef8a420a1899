"""Judge an estimate by its boxes, and say what was assumed and how the solver got there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association import CHI2_GATE, FinalEstimate, RepeatedNoise
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.calibration import CalibrationFinding, ClockError
from dqslam.estimate import Estimate
from dqslam.recording import Detections
from dqslam.solids import box_chi_squares
from dqslam.uncertainty import Marginals

# A map that fewer boxes show is worth a warning.
ENOUGH_EXPLAINED = 0.5
# Score tests take the errors of boxes for independent. Those of real detectors are not.
SURE_OF_CALIBRATION = 10.0  # sigmas


def box_chi2(
    estimate: Estimate, detections: Detections, noise: BoxNoise | Sequence[BoxNoise]
) -> NDArray[np.float64]:
    """Compare boxes with the estimate: chi-square with 4 dof, shape (m,).

    ``noise`` is that of all boxes, or one for each object of the estimate. Infinite where the
    object is not in front of the camera that saw it, no ellipsoid, or dropped.
    """
    if not len(estimate.object_ids):
        return np.full(len(detections), np.inf)
    row = np.searchsorted(estimate.object_ids, detections.object_id).clip(
        max=len(estimate.object_ids) - 1
    )
    mapped = estimate.object_ids[row] == detections.object_id
    noises = [noise] * len(estimate.object_ids) if isinstance(noise, BoxNoise) else noise
    covariance = np.zeros((len(detections), 4, 4))
    for number, one in enumerate(noises):
        covariance[row == number] = one.covariance(detections.box[row == number], estimate.camera)
    chi2 = box_chi_squares(
        estimate.pose_model,
        estimate.camera,
        estimate.poses[detections.pose],
        estimate.solids.take(row),
        detections.box,
        covariance.reshape(-1, 16),
        detections.truncated,
    )
    return np.where(mapped, chi2, np.inf)


def describe_boxes(chi2: NDArray[np.float64]) -> dict[str, Any]:
    """Count the boxes and those that do not fit, from their chi-squares (m,)."""
    return {
        "count": len(chi2),
        "chi2_median": float(np.median(chi2)) if len(chi2) else None,
        "outlier_share": float(np.mean(chi2 > CHI2_GATE[4])) if len(chi2) else None,
        "not_in_front": int(np.sum(np.isinf(chi2))),
    }


def warn_of_boxes(count: int, explained: int) -> list[str]:
    """Say that most boxes, or all of them, are of no object of the map."""
    if count == 0 or explained > ENOUGH_EXPLAINED * count:
        return []
    if explained == 0:
        return [f"the map is empty, though there are {count} boxes: the odometry is uncorrected"]
    return [
        f"only {explained} of {count} boxes show an object of the map: the trajectory rests on "
        "these, the others moved, were seen too rarely, or do not fit"
    ]


def warn_of_doubtful(estimate: Estimate) -> list[str]:
    """Name the objects in the map whose size or shape is not to be believed."""
    name_of = dict(zip(estimate.object_ids.tolist(), estimate.class_names, strict=True))
    return [f"object {one} ({name_of[one]}): {why}" for one, why in estimate.doubtful.items()]


def warn_of_contradictions(estimate: Estimate) -> list[str]:
    """Warn of objects that their own boxes contradict."""
    return [f"object {name} is contradicted: {why}" for name, why in estimate.contradicted.items()]


def warn_of_bent_poses(marginals: Marginals | None) -> list[str]:
    """Warn of poses that no Gaussian describes, because their headings are too uncertain."""
    if marginals is None or not marginals.is_bent.any():
        return []
    first = 2 if marginals.poses.shape[1] == 3 else 3
    variance = np.diagonal(marginals.poses, axis1=1, axis2=2)[:, first:]
    sigma = np.degrees(np.sqrt(np.nanmax(variance)))
    return [
        f"the rotations of {marginals.is_bent.sum()} poses are uncertain by up to {sigma:.1f} deg: "
        "their covariances are too narrow across the bow that these poses may lie on"
    ]


def warn_of_calibration(findings: Iterable[CalibrationFinding]) -> list[str]:
    """Warn of deviations from the calibration that even repeated errors of boxes do not explain."""
    return [str(finding) for finding in findings if finding.sigmas > SURE_OF_CALIBRATION]


def describe_clock(clock: ClockError) -> dict[str, Any]:
    """Describe the offset of time with which the map fits the boxes best."""
    return {
        "seconds": clock.seconds,
        "sigma_s": clock.sigma,
        "gain": clock.gain,
        "rate": clock.rate,
        "sure": clock.is_sure,
    }


def describe_calibration(estimated: tuple[CalibrationFinding, ...]) -> dict[str, Any]:
    """Describe what was estimated of the calibration, by the names of its parameters."""
    return {
        one.name: {"value": one.value, "sigma": one.sigma, "unit": one.unit} for one in estimated
    }


def describe_box_noise(noise: BoxNoise, repeated: RepeatedNoise | None) -> dict[str, Any]:
    """Describe the noise of an edge, and its parts where they were estimated."""
    if repeated is None:
        return asdict(noise)
    parts = {"new": asdict(repeated.new), "repeated": asdict(repeated.repeated)}
    return asdict(noise) | parts | {"correlation_angle_rad": repeated.angle}


def describe_evidence(final: FinalEstimate, path: NDArray[np.float64]) -> dict[str, Any]:
    """Say whether boxes that took no part agree with the estimate, or with odometry (n, d)."""
    known = final.gain[np.isfinite(final.gain)]
    distance = np.linalg.norm(final.poses[:, :3] - path[:, :3], axis=1)
    return {
        "log_likelihood_gain": float(known.sum()) if len(known) else None,
        "objects_for": int(np.sum(known > 0.0)),
        "objects_against": int(np.sum(known < 0.0)),
        "odometry_kept": final.keeps_odometry,
        "rms_correction_m": float(np.sqrt(np.mean(distance**2))),
    }


def warn_of_evidence(evidence: dict[str, Any] | None) -> list[str]:
    """Say that the boxes have not earned it."""
    if evidence is None or not evidence["odometry_kept"]:
        return []
    return [
        "the odometry is kept: it explains the boxes of objects that took no part as well as the "
        f"estimate does (log likelihoods differ by {evidence['log_likelihood_gain']:.3g})"
    ]


def describe_objects(
    estimate: Estimate,
    detections: Detections,
    chi2: NDArray[np.float64],
    marginals: Marginals | None,
) -> list[dict[str, Any]]:
    """Describe the place of each object, its size and its boxes."""
    centers = np.full((len(estimate.object_ids), 3, 3), np.nan)
    half_lengths = estimate.half_lengths
    if marginals is not None:
        centers = marginals.centers
    return [
        {
            "id": int(object_id),
            "class_name": estimate.class_names[row],
            "observations": int(estimate.observations[row]),
            "ellipsoid": bool(estimate.is_ellipsoid[row]),
            "center_m": estimate.centers[row].tolist(),
            "shape": _shape(estimate, row),
            "semi_axes_m": _numbers(estimate.semi_axes[row]),
            "half_lengths_m": _numbers(half_lengths[row]) if estimate.is_body[row] else None,
            "center_sigma_m": _number(np.sqrt(np.trace(centers[row]))),
            "doubt": estimate.doubtful.get(int(object_id)),
            "contradicted": estimate.contradicted.get(int(object_id)),
            **describe_boxes(chi2[detections.object_id == object_id]),
        }
        for row, object_id in enumerate(estimate.object_ids)
    ]


def _shape(estimate: Estimate, row: int) -> str | None:
    if not estimate.is_ellipsoid[row]:
        return None
    return estimate.object_shapes[row].name.lower() if estimate.object_shapes else "ellipsoid"


def _number(value: float) -> float | None:
    """Return a number for JSON, which knows no NaN."""
    return float(value) if np.isfinite(value) else None


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [_number(value) for value in values]


def describe_size_prior(prior: SizePrior | SizePriors) -> dict[str, Any]:
    """Describe one prior, or the default of a table and its classes."""
    if isinstance(prior, SizePriors):
        classes = {name: describe_size_prior(one) for name, one in prior.classes.items()}
        return describe_size_prior(prior.default) | {"classes": classes}
    return {"median_m": float(np.exp(prior.log_mean)), "log_sigma": prior.log_sigma}


def describe_solver(summary: _core.Summary) -> dict[str, Any]:
    """Say how the solver got there."""
    names = (
        "initial_cost",
        "final_cost",
        "iterations",
        "rejected_steps",
        "gradient_norm_start",
        "gradient_norm_end",
        "seconds",
        "converged",
        "message",
    )
    return {name: getattr(summary, name) for name in names}


def describe_times(milliseconds: NDArray[np.float64]) -> dict[str, float]:
    """Summarize the wall clock of all steps of a session, shape (n,)."""
    return {
        "step_ms_median": float(np.median(milliseconds)),
        "step_ms_p99": float(np.percentile(milliseconds, 99)),
        "step_ms_worst": float(milliseconds.max()),
        "total_s": float(milliseconds.sum() / 1e3),
    }
