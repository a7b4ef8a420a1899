"""The changes between two maps, seen from above."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from dqslam._checks import Floats
from dqslam.places.changes import STATUSES, Change, Changes
from dqslam.plot.above import CIRCLE, FromAbove, from_above
from dqslam.plot.labels import place_labels
from dqslam.plot.style import (
    BLUE,
    COLUMN_INCHES,
    GRAY,
    GREEN,
    ORANGE,
    VERMILLION,
    column_style,
    new_figure,
    save_figure,
    say_frame,
    shown_name,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLORS = {
    "stayed": GRAY,
    "moved": ORANGE,
    "vanished": VERMILLION,
    "appeared": GREEN,
    "unknown": BLUE,
}
_LATER_PATH: dict[str, Any] = {"color": GRAY, "linewidth": 0.6, "label": "later cameras"}
_MOST_NAMED = 30  # objects that all have their names


def plot_changes(found: Changes, path: str | Path) -> None:
    """Draw all objects in the frame of the second map, and arrows along which they moved.

    An object is a circle of its mean semi-axis, dashed where it is not any more. A line is the path
    of the cameras of the second map.
    """
    figure = draw_changes(found)
    with column_style():
        save_figure(figure, path)


def draw_changes(found: Changes) -> Figure:
    """Return the figure that ``plot_changes`` writes."""
    view = from_above(found.cameras)
    with column_style():
        figure = new_figure(COLUMN_INCHES, COLUMN_INCHES + 0.35)
        axes = figure.subplots()
        view.set_up(axes)
        if len(found.cameras):
            axes.plot(*view.points(found.cameras[:, :3]).T, **_LATER_PATH)
        circles = [_draw_object(axes, view, one) for one in found.objects]
        say_frame(axes, "from above, in the frame of the later map")
        _draw_legend(figure, found)
        axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
        has_all = len(found.objects) <= _MOST_NAMED  # else only what is not as it was
        named = [k for k, one in enumerate(found.objects) if has_all or one.status != "stayed"]
        place_labels(
            axes,
            [circles[k] for k in named],
            [_name(found.objects[k]) for k in named],
            [_COLORS[found.objects[k].status] for k in named],
            size=5.0,
        )
    return figure


def _name(one: Change) -> str:
    """Return the class and the id as in the table of changes: in the later map, if it is there."""
    number = f"A{one.first_id}" if one.second_id is None else f"B{one.second_id}"
    return f"{shown_name(one.class_name)} {number}"


def _draw_object(axes: Axes, view: FromAbove, one: Change) -> Floats:
    """Draw an object and, if it moved, where it was; return its circle (2, n)."""
    color = _COLORS[one.status]
    is_there = one.second_center is not None
    center = one.second_center if is_there else one.first_center
    assert center is not None  # an object is in one map at least
    place = view.points(center[None])[0]
    circle: Floats = place[:, None] + max(one.size, 0.02) * CIRCLE
    axes.fill(*circle, facecolor=color, alpha=0.25 if is_there else 0.0, linewidth=0)
    axes.plot(*circle, color=color, linestyle="-" if is_there else "--")
    if one.status == "moved" and one.first_center is not None:
        start = view.points(one.first_center[None])[0]
        axes.plot(*(start[:, None] + one.size * CIRCLE), color=color, linestyle="--")
        axes.annotate("", place, start, arrowprops={"arrowstyle": "->", "color": color})
    return circle


def _draw_legend(figure: Figure, found: Changes) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Artist] = [
        Patch(
            facecolor=(_COLORS[status], 0.25),
            edgecolor=_COLORS[status],
            label=f"{len(found.of(status))} {status}",
        )
        for status in STATUSES
        if found.of(status)
    ]
    if any(one.status == "moved" or one.second_center is None for one in found.objects):
        entries.append(Line2D([], [], color="0.2", linestyle="--", label="before"))
    if len(found.cameras):
        entries.append(Line2D([], [], **_LATER_PATH))
    figure.legend(
        handles=entries, loc="outside lower center", ncols=3, frameon=False, borderpad=0.1
    )
