"""Objects that hide parts of others.

What is seen of a convex outline behind other convex outlines is measured along parallel lines: each
line cuts an interval out of every outline.
"""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from dqslam._checks import Bools, Floats

Outline = Callable[[int, int], Floats]
"""Returns a closed convex polygon (k, 2), px, for the rows of a pose and an object."""

_LINES = 200  # across an outline, in each direction


def hide(
    box: Floats,
    in_front: Bools,
    is_wanted: Bools,
    distance: Floats,
    outline: Outline,
    max_hidden: float,
) -> tuple[Floats, Bools]:
    """Return the boxes (n, o, 4) of what is seen, and which objects are seen well enough (n, o).

    Parameters
    ----------
    box, in_front
        Exact boxes, px, and whether there is one.
    is_wanted
        Which boxes matter, (n, o); the others stay as they are, but hide what is behind them.
    distance
        Of the objects from the camera, m, shape (n, o); the nearer one hides the farther one.
    max_hidden
        An object of which more than this share of the area is hidden is not seen.
    """
    seen, enough = box.copy(), in_front.copy()
    outline = cache(outline)
    for pose, row in np.argwhere(in_front & is_wanted).tolist():
        one, others = box[pose, row], box[pose]
        meet = (others[:, :2] < one[2:]).all(axis=1) & (others[:, 2:] > one[:2]).all(axis=1)
        nearer = in_front[pose] & meet & (distance[pose] < distance[pose, row])
        if nearer.any():
            before = [outline(pose, other) for other in np.flatnonzero(nearer).tolist()]
            seen[pose, row], hidden = seen_box(one, outline(pose, row), before)
            enough[pose, row] = hidden <= max_hidden
    return seen, enough


def seen_box(box: Floats, outline: Floats, before: Sequence[Floats]) -> tuple[Floats, float]:
    """Return the box of the part of an outline that others leave, and the hidden share of it.

    An edge at which the outline is seen stays as it was. The box of what is wholly hidden is the
    whole box.
    """
    low_u, high_u, share = _seen_across(outline, before, lines_along=1)
    low_v, high_v, _ = _seen_across(outline, before, lines_along=0)
    if share == 0.0:
        return box, 1.0
    seen = np.array([low_u, low_v, high_u, high_v])
    # An edge that the outline touches between two lines is nearly, not exactly, found by them.
    spacing = np.tile((box[2:] - box[:2]) / _LINES, 2)
    return np.where(np.abs(seen - box) <= 2.0 * spacing, box, seen), 1.0 - share


def _seen_across(
    outline: Floats, before: Sequence[Floats], *, lines_along: int
) -> tuple[float, float, float]:
    """Return the least and largest coordinate that is seen on parallel lines, and the seen share.

    The lines have equal coordinates number `lines_along`; the other coordinate is returned.
    """
    ends = outline[:, lines_along].min(), outline[:, lines_along].max()
    lines = ends[0] + (np.arange(_LINES) + 0.5) / _LINES * (ends[1] - ends[0])
    low, high = _cut(outline, lines, lines_along)
    starts, stops = np.array([_cut(other, lines, lines_along) for other in before]).swapaxes(0, 1)
    order = np.argsort(starts, axis=0)  # (b, lines)
    starts = np.take_along_axis(starts, order, axis=0)
    stops = np.take_along_axis(stops, order, axis=0)
    first, last, hidden = low.copy(), high.copy(), np.zeros(_LINES)
    reached = low.copy()
    for start, stop in zip(starts, stops, strict=True):
        first = np.where((start <= first) & (stop > first), stop, first)
        hidden += np.clip(np.minimum(stop, high) - np.maximum(start, reached), 0.0, None)
        reached = np.maximum(reached, np.minimum(stop, high))
    for row in np.argsort(-stops, axis=0):
        start, stop = starts[row, np.arange(_LINES)], stops[row, np.arange(_LINES)]
        last = np.where((stop >= last) & (start < last), start, last)
    is_seen = first < last
    if not is_seen.any():
        return float("nan"), float("nan"), 0.0
    share = 1.0 - hidden.sum() / (high - low).sum()
    return float(first[is_seen].min()), float(last[is_seen].max()), float(share)


def _cut(outline: Floats, lines: Floats, along: int) -> tuple[Floats, Floats]:
    """Return the intervals that lines cut out of a polygon, empty ones at infinity."""
    one, two = outline[:-1], outline[1:]
    rise = two[:, along] - one[:, along]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (lines[:, None] - one[:, along]) / rise
        place = one[:, 1 - along] + share * (two - one)[:, 1 - along]
    meets = (share >= 0.0) & (share <= 1.0) & (rise != 0.0)
    low = np.where(meets, place, np.inf).min(axis=1)
    high = np.where(meets, place, -np.inf).max(axis=1)
    return low, np.where(meets.any(axis=1), high, np.inf)
