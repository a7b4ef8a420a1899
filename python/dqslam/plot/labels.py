"""Labels as tabs: each is of the color of its outline and touches it, so that it names no other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import ink_on

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ANCHORS = 16  # places on an outline
_DISTANCES = (0.0, 8.0, 16.0, 26.0)  # of a tab from its outline, in points; a line bridges them
_PAD = 0.8  # around the text, in points
_SAMPLES = np.stack(np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 3)), axis=-1)
# What a candidate costs: share of the tab over other outlines, over its own, share of an outline
# that it hides, distance in points, and how far it is from the top of its outline, where readers
# look first.
_OVER_OTHERS, _OVER_OWN, _HIDES, _PER_POINT, _NOT_ON_TOP = 3.0, 0.6, 2.0, 0.03, 0.12


def place_labels(
    axes: Axes,
    outlines: Sequence[Floats],
    texts: Sequence[str],
    colors: Sequence[str],
    *,
    size: float,
) -> int:
    """Write a text on a tab at each outline (2, n) and return their number.

    A tab touches its outline where it hides the least of others; if there is no free place at it, a
    line of its color leads there. No tab covers another: an outline without a place for one has
    none. Limits and size of the axes must be final. Sizes are in points.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    per_point = figure.dpi / 72.0
    frame = np.array(axes.get_window_extent().extents)
    shapes = [axes.transData.transform(one.T) for one in outlines]
    tabs: list[Floats] = []
    # Small outlines first: they have the fewest places.
    for row in np.argsort([np.prod(np.ptp(shape, axis=0)) for shape in shapes], kind="stable"):
        half = _text_size(axes, texts[row], size) / 2.0 + _PAD * per_point
        anchors, middles, distance = _candidates(shapes[row], half, frame, per_point)
        if not len(anchors):
            continue
        best = _cheapest(shapes, int(row), middles, distance / per_point, half, tabs)
        if best is None:
            continue
        tabs.append(np.concatenate([middles[best] - half, middles[best] + half]))
        to_data = axes.transData.inverted().transform
        line = {"arrowstyle": "-", "linewidth": 0.6, "color": colors[row], "shrinkA": 0}
        axes.annotate(
            texts[row],
            tuple(to_data(anchors[best])),
            xytext=tuple(to_data(middles[best])),
            fontsize=size,
            ha="center",
            va="center_baseline",
            color=ink_on(colors[row]),
            bbox={"pad": _PAD, "facecolor": colors[row], "alpha": 0.9, "linewidth": 0.0},
            arrowprops=line | {"shrinkB": 0} if distance[best] > 0 else None,
            zorder=6,
            parse_math=False,
            clip_on=True,
            gid="name",
        )
    return len(tabs)


def _text_size(axes: Axes, text: str, size: float) -> Floats:
    """Return width and height of a text in pixels."""
    written = axes.text(0, 0, text, fontsize=size, parse_math=False)
    bounds = written.get_window_extent()
    written.remove()
    return np.array([bounds.width, bounds.height])


def _candidates(
    shape: Floats, half: Floats, frame: Floats, per_point: float
) -> tuple[Floats, Floats, Floats]:
    """Return places in the frame: where a tab is tied (k, 2), its middle (k, 2), distance (k,)."""
    turn = np.linspace(0.0, 2.0 * np.pi, _ANCHORS, endpoint=False)
    outward = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    # The point of the outline that is farthest in each direction.
    anchors = shape[(outward @ shape.T).argmax(axis=1)]
    # From the anchor to the middle of a tab that just touches it.
    with np.errstate(divide="ignore"):
        reach = (half / np.abs(outward)).min(axis=1)
    found = []
    for distance in _DISTANCES:
        middles = anchors + outward * (reach + distance * per_point)[:, None]
        found.append((anchors, middles, np.full(_ANCHORS, distance * per_point)))
    found.append((anchors, anchors - outward * reach[:, None], np.zeros(_ANCHORS)))  # within
    tied, middle, away = (np.concatenate(part) for part in zip(*found, strict=True))
    low, high = frame[:2], frame[2:]
    inside = ((middle - half >= low) & (middle + half <= high)).all(axis=1)
    inside &= ((tied >= low - 1.0) & (tied <= high + 1.0)).all(axis=1)
    return tied[inside], middle[inside], away[inside]


def _cheapest(
    shapes: Sequence[Floats],
    own: int,
    middles: Floats,
    points: Floats,
    half: Floats,
    tabs: Sequence[Floats],
) -> int | None:
    """Return the candidate that hides the least, None if each would cover a tab."""
    low, high = middles - half, middles + half
    free = np.ones(len(middles), dtype=np.bool_)
    for tab in tabs:
        free &= ~((low < tab[2:]) & (high > tab[:2])).all(axis=1)
    if not free.any():
        return None
    samples = middles[:, None] + half * _SAMPLES.reshape(1, -1, 2)
    top = shapes[own][:, 1].max()
    tall = max(float(np.ptp(shapes[own][:, 1])), 1.0)
    cost = _PER_POINT * points + _NOT_ON_TOP * np.abs(top - middles[:, 1]).clip(max=tall) / tall
    for row, shape in enumerate(shapes):
        share = _covered(shape, samples)
        cost += (_OVER_OWN if row == own else _OVER_OTHERS) * share
        cost += _HIDES * _hidden(shape, low, high)
    return int(np.where(free, cost, np.inf).argmin())


def _covered(shape: Floats, samples: Floats) -> Floats:
    """Return the share of the samples (k, s, 2) of each tab that is within an outline (n, 2)."""
    from matplotlib.path import Path

    low, high = shape.min(axis=0), shape.max(axis=0)
    share = np.zeros(len(samples))
    near = ((samples >= low) & (samples <= high)).all(axis=2).any(axis=1)
    if len(shape) > 2 and near.any():
        inside = Path(shape).contains_points(samples[near].reshape(-1, 2))
        share[near] = inside.reshape(-1, samples.shape[1]).mean(axis=1)
    return share


def _hidden(shape: Floats, low: Floats, high: Floats) -> Floats:
    """Return the share of an outline (n, 2) that tabs of corners (k, 2), (k, 2) hide, (k,)."""
    share = np.zeros(len(low))
    near = ((high >= shape.min(axis=0)) & (low <= shape.max(axis=0))).all(axis=1)
    within = (shape > low[near, None]) & (shape < high[near, None])
    share[near] = within.all(axis=2).mean(axis=1)
    return share
