"""Boxes of an estimate, compared with its own objects and with true boxes."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam.io import BoxTable, Results, TrueBoxes, nearest_pose
from dqslam.metrics import match_boxes, reprojection_iou, score_association


def evaluate_reprojection(results: Results) -> dict[str, Any] | None:
    """Compare the boxes of mapped objects with the projections of these.

    There are results for all boxes that were used, for those of them that fit, and for those that
    were held out; None without boxes.
    """
    boxes = results.boxes
    if boxes is None:
        return None
    overlap = box_overlaps(results, boxes)
    mapped = np.isfinite(overlap)
    used = mapped & ~boxes.held_out
    return {
        **_describe(overlap, used),
        "inliers": _describe(overlap, used & boxes.inlier),
        "held_out": _describe(overlap, mapped & boxes.held_out),
    }


def box_overlaps(results: Results, boxes: BoxTable) -> Floats:
    """Return the IoU (m,) of each box with its projected object; NaN if it is not mapped."""
    objects = results.objects
    row_of = {int(number): row for row, number in enumerate(objects.object_ids)}
    row = np.array([row_of.get(int(number), -1) for number in boxes.object_id], dtype=np.int64)
    mapped = row >= 0
    overlap = np.full(len(boxes), np.nan)
    overlap[mapped] = reprojection_iou(
        results.camera,
        results.poses[boxes.pose[mapped]],
        objects.solids.take(row[mapped]),
        boxes.box[mapped],
        boxes.truncated[mapped],
    )
    return overlap


def _describe(overlap: Floats, chosen: Bools) -> dict[str, Any]:
    values = overlap[chosen]
    return {
        "boxes": len(values),
        "median": float(np.median(values)) if len(values) else None,
        "mean": float(np.mean(values)) if len(values) else None,
    }


def evaluate_association(
    results: Results,
    truth: TrueBoxes,
    *,
    min_iou: float = 0.5,
    max_time_difference: float | None = None,
) -> dict[str, Any]:
    """Compare the object of each box with that of the true box which it overlaps.

    Only boxes from poses with a true box are compared, because other images may be unlabeled. Boxes
    that overlap a true box without an id, or that were held out, are not compared either.

    Parameters
    ----------
    min_iou
        A box whose IoU with every true box is less than this shows no object.
    max_time_difference
        The largest time from a true box to its pose in seconds; by default half the median
        interval of poses.
    """
    boxes = results.boxes
    if boxes is None:
        raise ValueError(f"{results.directory}: there is no boxes.csv, hence no association")
    times = results.timestamps
    if max_time_difference is None:
        max_time_difference = 0.5 * float(np.median(np.diff(times)))
    true_pose, late = nearest_pose(times, truth.timestamp)
    near = late <= max_time_difference
    if not near.any():
        raise ValueError(
            f"{truth.path}: no box within {max_time_difference:g} s of a pose of the estimate"
        )
    true_pose, true_boxes, true_id = true_pose[near], truth.box[near], truth.object_id[near]
    compared = np.isin(boxes.pose, true_pose) & ~boxes.held_out
    pose, box = boxes.pose[compared], boxes.box[compared]
    match = match_boxes(pose, box, true_pose, true_boxes, min_iou=min_iou)
    shown = np.where(match >= 0, true_id[match], -1)
    known = (match < 0) | (shown >= 0)
    score = score_association(pose[known], boxes.object_id[compared][known], shown[known])
    return {"min_iou": min_iou, **asdict(score)}
