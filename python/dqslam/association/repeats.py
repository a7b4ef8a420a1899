"""Boxes that a detector drew twice on one thing in one image.

Without non-maximum suppression, or with it for each class by itself, one thing has several boxes in
an image, maybe of different classes. They overlap much more than things beside each other do, and
are one measurement: the surest box counts, and the others show what it shows.
"""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam.association.images import group_by_pose
from dqslam.metrics import box_iou
from dqslam.recording import Detections

# Boxes on one thing have this intersection over union at least. Of two things, one behind the
# other, boxes seldom have that, and then one of both does without a box in this image.
MIN_OVERLAP_OF_REPEATS = 0.7


def find_repeats(detections: Detections) -> Ints:
    """Return the row of the box that counts for each box, its own unless it is a repeat, (m,).

    From the surest box of an image down, the first of equally sure ones, a box is a repeat of the
    surest one that counts and that it overlaps.
    """
    counts = np.arange(len(detections))
    crowded = np.isin(detections.pose, np.unique(detections.pose[_that_overlap(detections)]))
    rows = np.flatnonzero(crowded)
    for _, group in group_by_pose(detections.pose[rows]):
        by_score = rows[group][np.argsort(-detections.score[rows[group]], kind="stable")]
        counts[by_score] = by_score[repeats_in_image(detections.box[by_score])]
    return counts


def repeats_in_image(box: Floats) -> Ints:
    """Return the row of the box that counts for each box (b, 4) of an image, the surest first."""
    same = box_iou(box[:, None], box) >= MIN_OVERLAP_OF_REPEATS
    counts = np.arange(len(box))
    for row in range(1, len(box)):
        surer = np.flatnonzero(same[row, :row] & (counts[:row] == np.arange(row)))
        if surer.size:
            counts[row] = surer[0]
    return counts


def _that_overlap(detections: Detections) -> Ints:
    """Return boxes that overlap another of their image as repeats do; not all, but one of each."""
    order = np.argsort(detections.pose, kind="stable")
    pose, box = detections.pose[order], detections.box[order]
    found = []
    for ahead in range(1, int(np.bincount(pose).max(initial=0))):
        first = np.flatnonzero(pose[ahead:] == pose[:-ahead])
        overlap = box_iou(box[first], box[first + ahead])
        found.append(order[first[overlap >= MIN_OVERLAP_OF_REPEATS]])
    return np.concatenate([np.zeros(0, dtype=np.int64), *found])
