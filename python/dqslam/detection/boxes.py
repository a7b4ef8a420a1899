"""Boxes of one image, and non-maximum suppression among those of one class."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats, Ints


@dataclass(frozen=True)
class Boxes:
    """What a detector says of one image.

    ``corner`` (m, 4) px, left, top, right, bottom, counted from the corner of the image, as
    detectors do; ``score`` (m,) 0..1; ``class_id`` (m,).
    """

    corner: Floats
    score: Floats
    class_id: Ints

    def __len__(self) -> int:
        """Return the number of boxes."""
        return len(self.score)

    def select(self, rows: Bools | Ints) -> Boxes:
        """Return the boxes of a mask (m,) or of row numbers."""
        return Boxes(self.corner[rows], self.score[rows], self.class_id[rows])


def best_class(corner: Floats, scores: Floats) -> Boxes:
    """Return boxes (m, 4) with the class of the highest of their scores (m, c)."""
    class_id = scores.argmax(axis=1)
    return Boxes(corner, scores[np.arange(len(scores)), class_id], class_id.astype(np.int64))


def corners_of_centers(center_and_size: Floats) -> Floats:
    """Return corners (m, 4) of boxes given as center and size (m, 4)."""
    half = 0.5 * center_and_size[:, 2:]
    center = center_and_size[:, :2]
    return np.hstack([center - half, center + half])


def suppress_by_class(boxes: Boxes, iou: float) -> Boxes:
    """Leave out boxes that overlap a better one of their class by more than ``iou``.

    The rest is in the order of scores; of equal scores, the first box counts as better.
    """
    ranked = boxes.select(np.argsort(-boxes.score, kind="stable"))
    waiting = np.arange(len(ranked))
    kept: list[int] = []
    while waiting.size:
        best, rest = int(waiting[0]), waiting[1:]
        kept.append(best)
        same_class = ranked.class_id[rest] == ranked.class_id[best]
        overlaps = _overlap(ranked.corner[best], ranked.corner[rest]) > iou
        waiting = rest[~(same_class & overlaps)]
    return ranked.select(np.array(kept, dtype=np.int64))


def _overlap(box: Floats, others: Floats) -> Floats:
    """Return the intersection over union of a box (4,) with others (m, 4), shape (m,)."""
    low = np.maximum(box[:2], others[:, :2])
    high = np.minimum(box[2:], others[:, 2:])
    both = np.prod(np.clip(high - low, 0.0, None), axis=1)
    union = np.prod(box[2:] - box[:2]) + np.prod(others[:, 2:] - others[:, :2], axis=1) - both
    shared: Floats = both / np.where(union > 0, union, 1.0)
    return shared
