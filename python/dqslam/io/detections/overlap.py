"""Boxes of one image that coincide: the same thing detected twice."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.io.detections.table import DetectionTable
from dqslam.io.notes import Notes

COINCIDE = 0.7  #: least intersection over union of boxes that surely show the same thing
USUAL = 0.5  #: what detectors suppress
FEW, MANY = 5, 0.05  #: number, and share of the boxes, that may coincide by chance


def suppress(table: DetectionTable, iou: float) -> Bools:
    """Return which boxes (m,) are left by non-maximum suppression, whatever their class.

    A box goes if it overlaps a better one of its image that stays by at least ``iou``. Of equal
    scores, the first counts as better.
    """
    first, second = overlapping(table, iou)
    keep = np.ones(len(table), dtype=np.bool_)
    if not first.size:
        return keep
    rank = np.empty(len(table), dtype=np.int64)
    rank[np.lexsort((np.arange(len(table)), -table.score))] = np.arange(len(table))
    better = np.where(rank[first] < rank[second], first, second)
    worse = np.where(rank[first] < rank[second], second, first)
    for row in np.argsort(rank[worse], kind="stable"):
        # All boxes that are better than this one are decided.
        if keep[better[row]]:
            keep[worse[row]] = False
    return keep


def overlapping(table: DetectionTable, iou: float) -> tuple[Ints, Ints]:
    """Return the pairs of rows, (p,) and (p,), of one image that overlap by at least ``iou``."""
    order = np.argsort(table.frame, kind="stable")
    frame, box = table.frame[order], table.box[order]
    pairs: list[tuple[Ints, Ints]] = []
    for step in range(1, len(table)):
        same = np.flatnonzero(frame[step:] == frame[:-step])
        if not same.size:
            break
        close = same[_iou(box[same], box[same + step]) >= iou]
        pairs.append((order[close], order[close + step]))
    if not pairs:
        none = np.zeros(0, dtype=np.int64)
        return none, none
    return np.concatenate([a for a, _ in pairs]), np.concatenate([b for _, b in pairs])


def doubt_doubles(table: DetectionTable, notes: Notes) -> None:
    """Note if many boxes coincide with a better one of their image."""
    if not len(table):
        return
    doubles = int(np.sum(~suppress(table, COINCIDE)))
    if doubles > max(FEW, MANY * len(table)):
        notes.doubt(
            table.path,
            f"{doubles} of {len(table)} boxes overlap a better one of their image by "
            f"{COINCIDE:.0%} or more: if they show the same thing, --nms {USUAL:g} leaves them out",
        )


def _iou(boxes: Floats, others: Floats) -> Floats:
    """Return the intersection over union of boxes (p, 4) with others (p, 4), shape (p,)."""
    low, high = np.maximum(boxes[:, :2], others[:, :2]), np.minimum(boxes[:, 2:], others[:, 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=1)
    areas = [np.prod(box[:, 2:] - box[:, :2], axis=1) for box in (boxes, others)]
    union = areas[0] + areas[1] - both
    shared: Floats = both / np.where(union > 0, union, 1.0)
    return shared
