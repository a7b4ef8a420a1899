"""The boxes around COCO's segmentations: polygons, and run lengths, packed or not."""

from __future__ import annotations

from typing import Any

import numpy as np

from dqslam.io.detections.json_list import Entry

MOST_PIXELS = 10**9


def segmentation_box(entry: Entry) -> list[float]:
    """Return x, y, width, height of the box around a segmentation, in COCO's pixels."""
    shape = entry.value("segmentation")
    if isinstance(shape, dict):
        return _run_length_box(entry, shape)
    if not isinstance(shape, list) or not shape:
        raise entry.error("segmentation is no list of polygons and no run lengths")
    polygons = shape if isinstance(shape[0], list) else [shape]
    points = []
    for polygon in polygons:
        if not isinstance(polygon, list) or len(polygon) < 6 or len(polygon) % 2:
            raise entry.error("segmentation has a polygon that is not x1 y1 x2 y2 x3 y3 ...")
        numbers = Entry(entry.path, entry.index, entry.line, {"segmentation": polygon})
        points.append(np.array(numbers.numbers("segmentation", len(polygon))).reshape(-1, 2))
    corners = np.vstack(points)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return [*low.tolist(), *(high - low).tolist()]


def _run_length_box(entry: Entry, shape: dict[str, Any]) -> list[float]:
    """Return the box around a mask of runs, which go down the columns and begin with zeros."""
    size, counts = shape.get("size"), shape.get("counts")
    if not isinstance(size, list) or len(size) != 2 or not all(isinstance(n, int) for n in size):
        raise entry.error("segmentation has no size [height, width]")
    runs = _unpacked(entry, counts) if isinstance(counts, str) else counts
    height, pixels = size[0], size[0] * size[1]
    whole = isinstance(runs, list) and all(isinstance(n, int) and n >= 0 for n in runs)
    if not isinstance(runs, list) or not whole or sum(runs) != pixels or pixels > MOST_PIXELS:
        raise entry.error("segmentation has counts that are no run lengths of its size")
    ends = np.cumsum(np.array(runs, dtype=np.int64))
    starts, ends = ends[:-1:2], ends[1::2]
    filled = ends > starts
    if not filled.any():
        return [0.0, 0.0, 0.0, 0.0]  # an empty mask is an empty box
    starts, ends = starts[filled], ends[filled] - 1
    left, right = int(starts.min() // height), int(ends.max() // height)
    # A run over the end of a column covers its last row and the first of the next column.
    across = starts // height != ends // height
    top = 0 if across.any() else int((starts % height).min())
    bottom = height - 1 if across.any() else int((ends % height).max())
    return [float(left), float(top), float(right - left + 1), float(bottom - top + 1)]


def _unpacked(entry: Entry, text: str) -> list[int]:
    """Unpack run lengths: groups of 5 bits, low first, from the third on as differences."""
    runs: list[int] = []
    at = 0
    while at < len(text):
        value, shift, more = 0, 0, True
        while more:
            if at == len(text) or not 0 <= ord(text[at]) - 48 < 64 or shift > 60:
                raise entry.error("segmentation has counts that are no packed run lengths")
            bits = ord(text[at]) - 48
            value |= (bits & 31) << shift
            more = bool(bits & 32)
            at, shift = at + 1, shift + 5
            if not more and bits & 16:
                value -= 1 << shift
        runs.append(value + (runs[-2] if len(runs) > 2 else 0))
    return runs
