"""Numbers of an estimate and its objects as text: pairs of a name and a value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dqslam._checks import Floats
from dqslam.evaluation import box_overlaps
from dqslam.io import Results, TrueObjects

Numbers = tuple[tuple[str, str], ...]


def overview(results: Results, evaluation: Mapping[str, Any]) -> Numbers:
    """Describe an estimate.

    ``evaluation`` is the result of ``evaluate_results``, or empty without truth.
    """
    path = np.linalg.norm(np.diff(results.poses[:, :3], axis=0), axis=1).sum()
    shown = [
        ("poses", f"{len(results.timestamps)} over {path:.4g} m"),
        ("objects", f"{len(results.objects)} mapped, {len(results.objects.dropped)} not"),
    ]
    if results.boxes is not None:
        held_out = int(results.boxes.held_out.sum())
        apart = f", {held_out} held out" if held_out else ""
        shown.append(("boxes", f"{len(results.boxes)}{apart}"))
    if not evaluation:
        return tuple(shown)
    shown += [
        ("position error, rmse", _meters(evaluation["ate"]["rmse"])),
        ("odometry error, rmse", _meters(evaluation["odometry_ate"]["rmse"])),
    ]
    objects = evaluation["objects"]
    if objects is not None:
        found = f"{objects['matched']} found, {objects['missed']} missed"
        shown.append(("true objects at rest", found))
    return tuple(shown)


def object_numbers(results: Results, evaluation: Mapping[str, Any]) -> list[Numbers]:
    """Describe each mapped object, with its errors if ``evaluation`` has true objects."""
    objects, boxes = results.objects, results.boxes
    overlap = None if boxes is None else box_overlaps(results, boxes)
    evaluated = evaluation.get("objects")
    pairs = {pair["id"]: pair for pair in evaluated["pairs"]} if evaluated else {}
    described = []
    for row in range(len(objects)):
        shown = [("center", f"{_vector(objects.centers[row])} m")]
        covariance = objects.center_covariances[row]
        if np.isfinite(covariance).all():
            shown.append(("σ of center", _lengths(np.sqrt(np.diag(covariance)))))
        if objects.is_body[row]:
            shown.append(("shape", objects.object_shapes[row].name.lower()))
            shown.append(("size", _lengths(2.0 * objects.half_lengths[row])))
            sigmas = objects.log_half_lengths_sigmas[row]
        else:
            if objects.is_ellipsoid[row]:
                shown.append(("size", _lengths(2.0 * objects.semi_axes[row])))
            sigmas = objects.log_semi_axes_sigmas[row]
        if np.isfinite(sigmas).all():
            shown.append(("σ of size", " × ".join(f"{100.0 * s:.2g} %" for s in sigmas)))
        if boxes is not None and overlap is not None:
            mine = boxes.object_id == objects.object_ids[row]
            held_out, used = mine & boxes.held_out, mine & ~boxes.held_out
            apart = f", {held_out.sum()} held out" if held_out.any() else ""
            shown.append(("boxes", f"{mine.sum()}{apart}"))
            shown.append(("fit", f"{(used & boxes.inlier).sum()} of {used.sum()} used"))
            known = overlap[mine & np.isfinite(overlap)]
            if len(known):
                shown.append(("IoU of boxes", f"{np.median(known):.3f}"))
        described.append(
            (*shown, *_errors(pairs.get(int(objects.object_ids[row])), bool(evaluated)))
        )
    return described


def true_object_numbers(true: TrueObjects, row: int) -> Numbers:
    """Describe one true object, in the world of the truth."""
    shown = [("true center", f"{_vector(true.center[row])} m")]
    if true.size is not None:
        shown.append(("true size", _lengths(true.size[row])))
    if not true.static[row]:
        shown.append(("at rest", "no, it moves"))
    return tuple(shown)


def _errors(pair: Mapping[str, Any] | None, evaluated: bool) -> Numbers:
    if pair is None:
        return (("truth", "no true object matches"),) if evaluated else ()
    shown = [("center error", _meters(pair["center"]))]
    if pair["true_id"] is not None:
        shown.insert(0, ("true id", str(pair["true_id"])))
    for title, key, form in (
        ("size error", "size_relative", "{:.0%}"),
        ("volume ratio", "volume_ratio", "{:.2f}"),
        ("orientation error", "orientation_deg", "{:.1f}°"),
        ("IoU in space", "iou_3d", "{:.2f}"),
    ):
        if pair[key] is not None:
            shown.append((title, form.format(pair[key])))
    return tuple(shown)


def _vector(values: Floats) -> str:
    return " ".join(f"{value:.3f}" for value in values)


def _lengths(values: Floats) -> str:
    """Write lengths side by side, in millimeters if none reaches 0.1 m."""
    if values.max() < 0.1:
        return " × ".join(f"{1e3 * value:.2g}" for value in values) + " mm"
    return " × ".join(f"{value:.3f}" for value in values) + " m"


def _meters(value: float) -> str:
    return f"{value:.3g} m"
