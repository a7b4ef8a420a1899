"""The changes between two maps, seen from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dqslam._checks import Floats
from dqslam.places.changes import STATUSES, Changes
from dqslam.plot.above import CIRCLE, FromAbove, from_above
from dqslam.plot.style import (
    BLUE,
    GRAY,
    GREEN,
    ORANGE,
    VERMILLION,
    new_figure,
    save_figure,
    shown_name,
)

_COLORS = {
    "stayed": GRAY,
    "moved": ORANGE,
    "vanished": VERMILLION,
    "appeared": GREEN,
    "unknown": BLUE,
}
_INCHES = 6.0


def plot_changes(found: Changes, path: str | Path) -> None:
    """Draw all objects in the frame of the second map, and arrows along which they moved.

    An object is a circle of its mean semi-axis, dashed where it is not any more. A line is the path
    of the cameras of the second map.
    """
    view = _view(found)
    figure = new_figure(_INCHES, _INCHES)
    axes = figure.subplots()
    if len(found.cameras):
        axes.plot(*view.points(found.cameras[:, :3]).T, color=GRAY, linewidth=0.6, alpha=0.6)
    for one in found.objects:
        color = _COLORS[one.status]
        is_there = one.second_center is not None
        center = one.second_center if is_there else one.first_center
        assert center is not None  # an object is in one map at least
        place = view.points(center[None])[0]
        circle = place[:, None] + max(one.size, 0.02) * CIRCLE
        axes.plot(*circle, color=color, linestyle="-" if is_there else "--")
        if one.status != "stayed":
            axes.annotate(
                shown_name(one.class_name),
                place,
                (4, 4),
                textcoords="offset points",
                fontsize=7,
                color=color,
            )
        if one.status == "moved" and one.first_center is not None:
            start = view.points(one.first_center[None])[0]
            axes.plot(*(start[:, None] + one.size * CIRCLE), color=color, linestyle="--")
            arrow = {"arrowstyle": "->", "color": color}
            axes.annotate("", place, start, arrowprops=arrow)
    for status in STATUSES:
        if found.of(status):
            axes.plot([], [], color=_COLORS[status], label=f"{len(found.of(status))} {status}")
    if found.objects:
        axes.legend(loc="best", fontsize=8)
    axes.set(aspect="equal", xlabel=view.labels[0], ylabel=view.labels[1])
    axes.grid(alpha=0.25, linewidth=0.5)
    if view.downward:
        axes.invert_yaxis()
    save_figure(figure, path)


def _view(found: Changes) -> FromAbove:
    """Return the view along the vertical of the cameras; along z without cameras."""
    if len(found.cameras) > 1:
        return from_above(found.cameras)
    axes: Floats = np.eye(3)[:2]
    return FromAbove(axes, ("x [m]", "y [m]"), downward=False)
