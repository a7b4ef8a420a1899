"""Where cameras of images are in a map, seen from above."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._colors import object_colors
from dqslam.places.landmarks import Landmarks
from dqslam.places.location.files import ImageLocation
from dqslam.plot.above import CIRCLE, FromAbove, from_above, outline
from dqslam.plot.labels import place_labels
from dqslam.plot.style import (
    BLUE,
    COLUMN_INCHES,
    GRAY,
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

# The largest map in which each object has its name, and the radius of one of unknown size [m].
_MOST_NAMED, _UNKNOWN_SIZE = 60, 0.02
# Contour of a position: 95 % of two coordinates.
_CHI = 2.45
_MAP_PATH: dict[str, Any] = {"color": GRAY, "linewidth": 0.6, "label": "cameras of the map"}
_FOUND: dict[str, Any] = {"color": BLUE, "label": "located, looks there, 95 %"}
_RIVAL: dict[str, Any] = {"color": VERMILLION, "label": "may be here: not sure"}


def plot_locations(known: Landmarks, answers: list[ImageLocation], path: str | Path) -> None:
    """Draw a map and the answers of ``locate``; see ``draw_locations``."""
    figure = draw_locations(known, answers)
    with column_style():
        save_figure(figure, path)


def draw_locations(known: Landmarks, answers: list[ImageLocation]) -> Figure:
    """Draw objects as circles in the colors of their classes, and each answer.

    An answer is a position, a direction of view and an ellipse that has it with 95 %.

    An image without an answer has crosses at the poses that it may have, the more probable the less
    transparent. A line is the path of the cameras of the map.
    """
    cameras = np.zeros((0, 7)) if known.results is None else known.results.poses
    view = from_above(cameras)
    with column_style():
        figure = new_figure(COLUMN_INCHES, COLUMN_INCHES + 0.35)
        axes = figure.subplots()
        view.set_up(axes)
        if len(cameras):
            axes.plot(*view.points(cameras[:, :3]).T, **_MAP_PATH)
        sizes = np.nan_to_num(known.semi_axes.mean(axis=1), nan=_UNKNOWN_SIZE)
        circles = [
            place[:, None] + size * CIRCLE
            for place, size in zip(view.points(known.centers), sizes, strict=True)
        ]
        colors = object_colors(known.class_names)
        for circle, color in zip(circles, colors, strict=True):
            axes.fill(*circle, facecolor=color, alpha=0.25, linewidth=0)
            axes.plot(*circle, color=color, linewidth=0.9)
        _draw_answers(axes, view, known, answers)
        found = sum(one.location.is_found for one in answers)
        say_frame(axes, f"{found} of {len(answers)} located; from above, in the frame of the map")
        _draw_legend(figure, known, answers)
        if len(known) <= _MOST_NAMED:
            axes.set(xlim=axes.get_xlim(), ylim=axes.get_ylim())
            named = zip(known.class_names, known.object_ids, strict=True)
            names = [f"{shown_name(name)} {number}" for name, number in named]
            place_labels(axes, circles, names, colors, size=5.0)
    return figure


def _draw_answers(
    axes: Axes, view: FromAbove, known: Landmarks, answers: list[ImageLocation]
) -> None:
    from scipy.spatial.transform import Rotation

    length = 0.05 * float(np.linalg.norm(np.ptp(view.points(known.centers), axis=0)))
    for one in answers:
        if not one.location.is_found:
            for rival in one.location.candidates:
                share = 0.2 + 0.8 * float(np.clip(rival.probability, 0.0, 1.0))
                place = view.points(rival.pose[None, :3])[0]
                axes.plot(*place, "x", color=VERMILLION, markersize=3, alpha=share)
            continue
        turn = Rotation.from_quat(one.location.pose[3:]).as_matrix()
        place = view.points(one.location.pose[None, :3])[0]
        ahead = np.stack([place, place + length * view.axes @ turn[:, 2]])
        axes.plot(*ahead.T, color=BLUE)
        axes.plot(*place, ".", color=BLUE, markersize=4)
        # The covariance is in the frame of the camera.
        turned = view.axes @ turn
        shape = _CHI**2 * turned @ one.location.covariance[:3, :3] @ turned.T
        axes.plot(*outline(place, shape), color=BLUE, linewidth=0.6)


def _draw_legend(figure: Figure, known: Landmarks, answers: list[ImageLocation]) -> None:
    """Explain what is drawn; objects have their names beside them."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Artist] = []
    if any(one.location.is_found for one in answers):
        entries.append(Line2D([], [], marker=".", markersize=4, **_FOUND))
    if any(one.location.candidates for one in answers if not one.location.is_found):
        entries.append(Line2D([], [], marker="x", markersize=3, lw=0, **_RIVAL))
    if known.results is not None:
        entries.append(Line2D([], [], **_MAP_PATH))
    entries.append(
        Patch(facecolor=(GRAY, 0.25), edgecolor=GRAY, label="object, by its mean radius")
    )
    figure.legend(
        handles=entries, loc="outside lower center", ncols=2, frameon=False, borderpad=0.1
    )
