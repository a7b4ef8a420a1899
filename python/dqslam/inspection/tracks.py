"""Boxes that show the same object, by their ids or by the overlap from frame to frame."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dqslam.io import DetectionTable
from dqslam.io.recording import object_ids

Ids = Literal["track_id", "class_id"]

# Boxes of one class that overlap by this much in successive frames show one object.
LEAST_OVERLAP = 0.5
# Boxes of one class that overlap by this much in one image show one object.
SAME_OVERLAP = 0.7
MOST_ALIKE = 50  #: boxes of one class in an image that are compared with each other
# A class with a single box in this share of its frames has one object.
ALONE_SHARE = 0.95
# The least number of boxes of a useful track, and the largest one that is used, to save time.
FEWEST_VIEWS, MOST_VIEWS = 5, 40
FEWEST_TRACKS, MOST_TRACKS = 3, 150
LEAST_SCORE = 0.3
# The most frames that are looked at, in this number of parts.
MOST_FRAMES, PARTS = 2000, 20


def find_tracks(table: DetectionTable, ids: Ids | None) -> list[NDArray[np.int64]]:
    """Return the rows of each track, in order of frames; longest tracks first.

    Without ``ids``, boxes are joined by their overlap. If that finds almost nothing, because images
    are far apart, boxes of a class with one object are joined. Of two boxes of an object in a frame
    the one with the better score counts. Of long recordings, parts are looked at. Ids of
    tracks that the file does not have are a FileError.
    """
    rows = np.flatnonzero(table.score >= min(LEAST_SCORE, float(np.median(table.score))))
    rows = rows[_in_parts(table.frame[rows])]
    rows = rows[~doubles(table, rows)]
    if ids is not None:
        return _grouped(table, rows, object_ids(table, ids)[rows])
    tracks = _grouped(table, rows, overlap_ids(table, rows))
    if len(tracks) >= FEWEST_TRACKS:
        return tracks
    return tracks + _grouped(table, rows, _lone_classes(table, rows))


def overlap_ids(table: DetectionTable, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give boxes (m,) one number if each overlaps the other best, from one frame to the next."""
    label = np.full(len(rows), -1, dtype=np.int64)
    order = np.argsort(table.frame[rows], kind="stable")
    starts = np.flatnonzero(np.diff(table.frame[rows][order])) + 1
    fresh = 0
    previous: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    for here in np.split(order, starts):
        if previous.size:
            shared = overlap(table.box[rows[previous]], table.box[rows[here]])
            same = table.class_id[rows[previous]][:, None] == table.class_id[rows[here]]
            shared = np.where(same, shared, 0)
            best = np.argmax(shared, axis=0)
            mutual = np.argmax(shared, axis=1)[best] == np.arange(len(here))
            joined = mutual & (shared[best, np.arange(len(here))] >= LEAST_OVERLAP)
            label[here[joined]] = label[previous[best[joined]]]
        new = here[label[here] < 0]
        label[new] = np.arange(fresh, fresh + len(new))
        fresh += len(new)
        previous = here
    return label


def overlap(boxes: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return intersection over union of boxes (a, 4) with others (b, 4): shape (a, b)."""
    return _shared(boxes[:, None], others[None])


def _shared(boxes: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    low = np.maximum(boxes[..., :2], others[..., :2])
    high = np.minimum(boxes[..., 2:], others[..., 2:])
    both = np.prod(np.clip(high - low, 0, None), axis=-1)
    areas = [np.prod(box[..., 2:] - box[..., :2], axis=-1) for box in (boxes, others)]
    union = areas[0] + areas[1] - both
    shared: NDArray[np.float64] = both / np.where(union > 0, union, 1.0)
    return shared


def doubles(table: DetectionTable, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which boxes (m,) show what a better box of their class in the same image shows."""
    double = np.zeros(len(rows), dtype=np.bool_)
    order = np.lexsort((-table.score[rows], table.class_id[rows], table.frame[rows]))
    boxes = table.box[rows][order]
    frame, number = table.frame[rows][order], table.class_id[rows][order]
    for step in range(1, MOST_ALIKE):
        same = (frame[step:] == frame[:-step]) & (number[step:] == number[:-step])
        if not same.any():
            break
        later = np.flatnonzero(same) + step
        shared = _shared(boxes[later], boxes[later - step])
        double[order[later[shared >= SAME_OVERLAP]]] = True
    return double


def _lone_classes(table: DetectionTable, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Label boxes (m,) by their class if it has one object, else by -1."""
    label = np.full(len(rows), -1, dtype=np.int64)
    for number in np.unique(table.class_id[rows]).tolist():
        of_class = np.flatnonzero(table.class_id[rows] == number)
        frames, counts = np.unique(table.frame[rows[of_class]], return_counts=True)
        if np.mean(counts == 1) >= ALONE_SHARE:
            alone = np.isin(table.frame[rows[of_class]], frames[counts == 1])
            label[of_class[alone]] = number
    return label


def _grouped(
    table: DetectionTable, rows: NDArray[np.int64], label: NDArray[np.int64]
) -> list[NDArray[np.int64]]:
    rows, label = rows[label >= 0], label[label >= 0]
    if not rows.size:
        return []
    order = np.lexsort((-table.score[rows], table.frame[rows], label))
    rows, label = rows[order], label[order]
    again = (label[1:] == label[:-1]) & (table.frame[rows][1:] == table.frame[rows][:-1])
    keep = np.concatenate([[True], ~again])
    rows, label = rows[keep], label[keep]
    groups = np.split(rows, np.flatnonzero(np.diff(label)) + 1)
    seen_often = sorted((group for group in groups if len(group) >= FEWEST_VIEWS), key=len)
    return seen_often[::-1][:MOST_TRACKS]


def _in_parts(frame: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Choose boxes (m,) of at most MOST_FRAMES frames: parts of successive ones, evenly spaced."""
    frames = np.unique(frame)
    if len(frames) <= MOST_FRAMES:
        return np.ones(len(frame), dtype=np.bool_)
    part = np.arange(len(frames)) * PARTS // len(frames)
    start = np.searchsorted(part, np.arange(PARTS))
    chosen = np.arange(len(frames)) - start[part] < MOST_FRAMES // PARTS
    return np.asarray(chosen[np.searchsorted(frames, frame)])


def thinned(group: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return at most MOST_VIEWS rows of a track (n,), evenly spaced."""
    if len(group) <= MOST_VIEWS:
        return group
    kept: NDArray[np.int64] = group[np.linspace(0, len(group) - 1, MOST_VIEWS).round().astype(int)]
    return kept
