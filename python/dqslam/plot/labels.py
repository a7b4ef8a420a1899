"""Labels beside outlines, where there is free space."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dqslam._checks import Bools, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DIRECTIONS = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)])
_DISTANCES = (3.0, 8.0, 14.0, 22.0)  # distances from the outline, in points
_LEADER_FROM = 8.0
_APART = 0.8  # free space around a text, in points


def place_labels(
    axes: "Axes",
    outlines: Sequence[Floats],
    texts: Sequence[str],
    colors: Sequence[str],
    *,
    size: float,
) -> int:
    """Write a text beside each outline (2, n), so that none covers another; return their number.

    A text is at the nearest of some candidate places that is free. If it is far, a line in the
    color of the outline leads to it. An outline without a free place gets no text. Limits and size
    of the axes must be final.
    """
    from matplotlib.patheffects import withStroke

    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    to_pixels, to_data = axes.transData.transform, axes.transData.inverted().transform
    frame = np.array(axes.get_window_extent().extents)
    boxes = [_bounds(to_pixels(one.T)) for one in outlines]
    shown = [bool(_overlaps(frame, box[None])[0]) for box in boxes]
    taken = [box for box, one in zip(boxes, shown, strict=True) if one]
    written = 0
    for box, text, color, one in zip(boxes, texts, colors, shown, strict=True):
        if not one:
            continue
        place = _free_place(box, _text_size(axes, text, size), frame, taken, figure.dpi / 72.0)
        if place is None:
            continue
        where, distance = place
        taken.append(where)
        line = {"arrowstyle": "-", "linewidth": 0.4, "color": color, "shrinkA": 0, "shrinkB": 0}
        target, middle = (to_data((one[:2] + one[2:]) / 2.0) for one in (box, where))
        axes.annotate(
            text,
            (target[0], target[1]),
            xytext=(middle[0], middle[1]),
            fontsize=size,
            ha="center",
            va="center",
            color="0.15",
            bbox={"pad": 0.5, "facecolor": "none", "linewidth": 0.0},  # the end of the line
            arrowprops=line if distance >= _LEADER_FROM else None,
            zorder=6,
            parse_math=False,
            path_effects=[withStroke(linewidth=1.2, foreground="white")],
        )
        written += 1
    return written


def _text_size(axes: "Axes", text: str, size: float) -> Floats:
    """Return width and height of a text in pixels."""
    written = axes.text(0, 0, text, fontsize=size, parse_math=False)
    bounds = written.get_window_extent()
    written.remove()
    return np.array([bounds.width, bounds.height])


def _free_place(
    box: Floats, size: Floats, frame: Floats, taken: Sequence[Floats], per_point: float
) -> tuple[Floats, float] | None:
    """Return the box (4,) of a text of a size, in pixels, and its distance in points."""
    half = size / 2.0 + _APART * per_point
    middle, reach = (box[:2] + box[2:]) / 2.0, (box[2:] - box[:2]) / 2.0
    others = np.array(taken)
    for distance in _DISTANCES:
        for direction in _DIRECTIONS:
            at = middle + direction * (reach + half + distance * per_point)
            place = np.concatenate([at - half, at + half])
            inside = (place[:2] >= frame[:2]).all() and (place[2:] <= frame[2:]).all()
            if inside and not _overlaps(place, others).any():
                return place, distance
    return None


def _bounds(points: Floats) -> Floats:
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def _overlaps(box: Floats, others: Floats) -> Bools:
    """Return whether a box (4,) overlaps others (m, 4), which may be points."""
    low, high = np.maximum(box[:2], others[:, :2]), np.minimum(box[2:], others[:, 2:])
    return np.asarray((high >= low).all(axis=1))
