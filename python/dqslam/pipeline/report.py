"""Judge an estimate by its boxes, and say what was assumed and how the solver got there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association import CHI2_GATE
from dqslam.assumptions import BoxNoise, SizePrior, SizePriors
from dqslam.calibration import CalibrationFinding
from dqslam.estimate import Estimate
from dqslam.recording import Detections

# A map that fewer boxes show is worth a warning.
ENOUGH_EXPLAINED = 0.5
# Score tests take the errors of boxes for independent. Those of real detectors are not.
SURE_OF_CALIBRATION = 10.0  # sigmas


def box_chi2(estimate: Estimate, detections: Detections, noise: BoxNoise) -> NDArray[np.float64]:
    """Compare boxes with the estimate: chi-square with 4 dof, shape (m,).

    Infinite where the object is not in front of the camera that saw it, no ellipsoid, or dropped.
    """
    if not len(estimate.object_ids):
        return np.full(len(detections), np.inf)
    row = np.searchsorted(estimate.object_ids, detections.object_id).clip(
        max=len(estimate.object_ids) - 1
    )
    mapped = estimate.object_ids[row] == detections.object_id
    chi2 = _core.box_chi_squares(
        estimate.pose_model,
        estimate.camera,
        estimate.poses[detections.pose],
        estimate.ellipsoids[row],
        detections.box,
        noise.covariance(detections.box, estimate.camera).reshape(-1, 16),
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


def warn_of_calibration(findings: tuple[CalibrationFinding, ...]) -> list[str]:
    """Warn of deviations from the calibration that even repeated errors of boxes do not explain."""
    return [str(finding) for finding in findings if finding.sigmas > SURE_OF_CALIBRATION]


def describe_objects(
    estimate: Estimate, detections: Detections, chi2: NDArray[np.float64]
) -> list[dict[str, Any]]:
    """Describe the boxes of each object."""
    return [
        {
            "id": int(object_id),
            "class_name": estimate.class_names[row],
            "observations": int(estimate.observations[row]),
            "ellipsoid": bool(estimate.is_ellipsoid[row]),
            **describe_boxes(chi2[detections.object_id == object_id]),
        }
        for row, object_id in enumerate(estimate.object_ids)
    ]


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
