"""Boxes kept from the estimator: how well it predicts what it has not seen."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dqslam import _core
from dqslam.association.images import group_by_pose
from dqslam.estimate import Estimate
from dqslam.metrics import box_iou
from dqslam.recording import Detections
from dqslam.solids import project_to_boxes

# Boxes that overlap less do not show the object.
LEAST_OVERLAP = 0.1


def choose_held_out(count: int, share: float, *, seed: int) -> NDArray[np.bool_]:
    """Choose boxes at random: a flag for each, shape (count,).

    Raises
    ------
    ValueError
        For a share that is not in [0, 1).
    """
    if not 0.0 <= share < 1.0:
        raise ValueError(f"the share to hold out is {share:g}, not at least 0 and below 1")
    chosen = np.zeros(count, dtype=np.bool_)
    rows = np.random.default_rng(seed).permutation(count)[: round(share * count)]
    chosen[rows] = True
    return chosen


def overlap_with_map(
    estimate: Estimate, boxes: Detections
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the IoU of boxes with the object of their class that they show, (m,), and its id.

    Boxes with an id are compared with their object. Of the others in an image, pairs are chosen so
    that the overlaps with the re-projected objects add up to the most. 0 and -1 where no object is
    left, NaN where none of the map has the class.
    """
    from scipy.optimize import linear_sum_assignment

    overlap = np.zeros(len(boxes))
    shown = np.full(len(boxes), -1, dtype=np.int64)
    names = np.array([boxes.class_names[int(number)] for number in boxes.class_id], dtype=object)
    mapped = np.array(estimate.class_names, dtype=object)
    real = np.flatnonzero(estimate.is_ellipsoid)
    solids = estimate.solids.take(real)
    for pose, rows in group_by_pose(boxes.pose):
        here = np.repeat(estimate.poses[pose][None], len(real), axis=0)
        predicted, in_front = project_to_boxes(estimate.pose_model, estimate.camera, here, solids)
        predicted = _inside(estimate.camera, np.where(in_front[:, None], predicted, -2.0))
        table = box_iou(boxes.box[rows][:, None], predicted[None])
        claimed = boxes.object_id[rows][:, None]
        same = np.where(
            claimed >= 0,
            claimed == estimate.object_ids[real],
            names[rows][:, None] == mapped[real],
        )
        table = np.where(same & (table >= LEAST_OVERLAP), table, 0.0)
        row, column = linear_sum_assignment(table, maximize=True)
        overlap[rows[row]] = table[row, column]
        shown[rows[row]] = np.where(table[row, column] > 0, estimate.object_ids[real[column]], -1)
    overlap[~np.isin(names, mapped)] = np.nan
    return overlap, shown


def describe_overlap(overlap: NDArray[np.float64]) -> dict[str, Any]:
    """Describe overlaps with the map (m,): of boxes that show an object, and how many do."""
    known = overlap[np.isfinite(overlap)]
    shown = known[known > 0.0]
    return {
        "boxes": len(overlap),
        "of_mapped_classes": len(known),
        "matched": len(shown),
        "iou_median": float(np.median(shown)) if len(shown) else None,
        "explained_share": float(np.mean(known >= 0.5)) if len(known) else None,
    }


def _inside(camera: _core.Camera, box: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cut boxes to the image, as a detector's are; what is outside becomes empty."""
    last = np.array([camera.width, camera.height]) - 0.5
    return np.clip(box, -0.5, np.tile(last, 2))
