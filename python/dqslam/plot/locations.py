"""Where cameras of images are in a map, seen from above."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dqslam.places.landmarks import Landmarks
from dqslam.places.locate_files import ImageLocation
from dqslam.plot.above import CIRCLE, FromAbove, from_above, outline
from dqslam.plot.style import (
    BLUE,
    GRAY,
    VERMILLION,
    new_figure,
    save_figure,
    say_frame,
    shown_name,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_INCHES = 6.0
# The largest map in which each object has its name, and the radius of one of unknown size [m].
_MOST_NAMED, _UNKNOWN_SIZE = 60, 0.02
# Contour of a position: 95 % of two coordinates.
_CHI = 2.45


def plot_locations(known: Landmarks, answers: list[ImageLocation], path: str | Path) -> None:
    """Draw a map and the answers of ``locate``; see ``draw_locations``."""
    save_figure(draw_locations(known, answers), path)


def draw_locations(known: Landmarks, answers: list[ImageLocation]) -> Figure:
    """Draw objects as circles, and each answer: its position, direction of view and uncertainty.

    An image without an answer has crosses at the poses that it may have, the more probable the less
    transparent. A line is the path of the cameras of the map.
    """
    from scipy.spatial.transform import Rotation

    cameras = np.zeros((0, 7)) if known.results is None else known.results.poses
    if len(cameras) > 1:
        view = from_above(cameras)
    else:
        view = FromAbove(np.eye(3)[:2], ("x [m]", "y [m]"), downward=False)
    figure = new_figure(_INCHES, _INCHES)
    axes = figure.subplots()
    if len(cameras):
        axes.plot(*view.points(cameras[:, :3]).T, color=GRAY, linewidth=0.6, alpha=0.6)
    sizes = np.nan_to_num(known.semi_axes.mean(axis=1), nan=_UNKNOWN_SIZE)
    for place, size, name in zip(view.points(known.centers), sizes, known.class_names, strict=True):
        axes.plot(*(place[:, None] + size * CIRCLE), color=GRAY, linewidth=0.8)
        if len(known) <= _MOST_NAMED:
            axes.annotate(shown_name(name), place, fontsize=6, color=GRAY, ha="center", va="center")
    length = 0.05 * float(np.linalg.norm(np.ptp(view.points(known.centers), axis=0)))
    for one in answers:
        if not one.location.is_found:
            for rival in one.location.candidates:
                share = 0.2 + 0.8 * float(np.clip(rival.probability, 0.0, 1.0))
                axes.plot(*view.points(rival.pose[None, :3])[0], "x", color=VERMILLION, alpha=share)
            continue
        turn = Rotation.from_quat(one.location.pose[3:]).as_matrix()
        place = view.points(one.location.pose[None, :3])[0]
        ahead = np.stack([place, place + length * view.axes @ turn[:, 2]])
        axes.plot(*ahead.T, color=BLUE)
        axes.plot(*place, ".", color=BLUE)
        # The covariance is in the frame of the camera.
        turned = view.axes @ turn
        shape = _CHI**2 * turned @ one.location.covariance[:3, :3] @ turned.T
        axes.plot(*outline(place, shape), color=BLUE, linewidth=0.6)
    found = sum(one.location.is_found for one in answers)
    say_frame(axes, f"{found} of {len(answers)} located (crosses: poses of those that are not)")
    axes.set(aspect="equal", xlabel=view.labels[0], ylabel=view.labels[1])
    axes.grid(alpha=0.25, linewidth=0.5)
    if view.downward:
        axes.invert_yaxis()
    return figure
