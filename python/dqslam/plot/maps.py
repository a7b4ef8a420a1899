"""Maps seen from above."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.estimate import Estimate
from dqslam.plot.above import FromAbove, outline
from dqslam.plot.style import ESTIMATE, ODOMETRY, TRUTH, new_figure, save_figure
from dqslam.recording import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMNS = 3
_AROUND_M = 8.0  # largest margin around the truth, which limits the effect of a lost estimate
_PANEL_INCHES = 4.2
_DPI = 150


def plot_maps(maps: Sequence[tuple[str, Estimate, Truth]], path: str | Path) -> None:
    """Draw maps of (title, estimate, truth) side by side, at the same scale, into an image file.

    Trajectories are lines, and objects are outlines from above. A true object that is not an
    ellipsoid is a disc of its volume; a mapped object that is not an ellipsoid is a cross.
    """
    if not maps:
        raise ValueError("there are no maps to draw")
    columns = min(_COLUMNS, len(maps))
    rows = -(-len(maps) // columns)
    low, high = _window(maps)
    height = _PANEL_INCHES * (high - low)[1] / (high - low)[0]
    figure = new_figure(_PANEL_INCHES * columns + 0.6, (height + 0.25) * rows + 0.9)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, (title, estimate, truth) in zip(grid.flat, maps, strict=False):
        _draw_map(axes, estimate, truth)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.25, linewidth=0.5)
    for axes in grid.flat[len(maps) :]:
        axes.set_axis_off()
    for axes in grid[-1]:
        axes.set_xlabel("x [m]")
    for axes in grid[:, 0]:
        axes.set_ylabel("y [m]")
    _draw_legend(figure, crosses=any(not estimate.is_ellipsoid.all() for _, estimate, _ in maps))
    save_figure(figure, path, dpi=_DPI)


def _window(maps: Sequence[tuple[str, Estimate, Truth]]) -> tuple[Floats, Floats]:
    """Return the corners (2,) of the window, with the truth and everything near it."""
    lows, highs = [], []
    for _, estimate, truth in maps:
        low, high = truth.poses[:, :2].min(axis=0), truth.poses[:, :2].max(axis=0)
        others = np.vstack([estimate.initial_poses, estimate.poses])[:, :2]
        lows.append(np.clip(others.min(axis=0), low - _AROUND_M, low) - 1.0)
        highs.append(np.clip(others.max(axis=0), high, high + _AROUND_M) + 1.0)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _draw_map(axes: "Axes", estimate: Estimate, truth: Truth) -> None:
    _draw_path(axes, estimate.initial_poses, color=ODOMETRY, linewidth=1.1)
    _draw_path(axes, truth.poses, color=TRUTH, linewidth=3.0, alpha=0.8)
    _draw_path(axes, estimate.poses, color=ESTIMATE, linewidth=1.1)
    axes.plot(*truth.poses[0, :2], "o", color="black", markersize=4, zorder=3)
    for one in _true_outlines(truth):
        axes.fill(*one, color=TRUTH, alpha=0.4, linewidth=0)
    view = FromAbove(np.eye(3)[:2], ("x [m]", "y [m]"), downward=False)
    for one in view.solid_outlines(estimate.solids):
        if one.shape[1] > 1:
            axes.plot(*one, color=ESTIMATE, linewidth=1.2)
        else:
            axes.plot(*one, "x", color=ESTIMATE, markersize=5)


def _draw_legend(figure: "Figure", *, crosses: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=ODOMETRY, linewidth=1.1, label="odometry"),
        Line2D([], [], color=TRUTH, linewidth=3.0, alpha=0.8, label="truth"),
        Line2D([], [], color=ESTIMATE, linewidth=1.1, label="estimate"),
        Line2D([], [], color="black", marker="o", linewidth=0, markersize=4, label="start"),
        Line2D([], [], color=TRUTH, marker="o", alpha=0.4, linewidth=0, label="true object"),
        Line2D(
            [], [], color=ESTIMATE, marker="o", fillstyle="none", linewidth=0, label="mapped object"
        ),
    ]
    if crosses:
        handles.append(
            Line2D([], [], color=ESTIMATE, marker="x", linewidth=0, label="mapped, no ellipsoid")
        )
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)


def _draw_path(axes: "Axes", poses: Floats, **style: Any) -> None:
    axes.plot(*poses[:, :2].T, solid_capstyle="round", **style)


def _true_outlines(truth: Truth) -> list[Floats]:
    """Return the outlines of the true objects from above, each (2, n), meters."""
    if truth.ellipsoids is None:
        radii = np.cbrt(0.75 / np.pi * truth.volumes)
        shapes = radii[:, None, None] ** 2 * np.eye(3)
    else:
        shapes = _core.ellipsoid_shapes(truth.ellipsoids)
    return [_outline(*one) for one in zip(truth.centers, shapes, strict=True)]


def _outline(center: Floats, shape: Floats) -> Floats:
    """Return the outline from above, (2, n), of an ellipsoid: an ellipse of shape S_xy."""
    return outline(center[:2], shape[:2, :2])
