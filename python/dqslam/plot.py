"""Maps seen from above."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.estimate import Estimate, quadric_shapes
from dqslam.recording import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# The paper's colours, in shades that the colour-blind can tell apart (Okabe and Ito).
ODOMETRY, TRUTH, ESTIMATE = "#0072B2", "#009E73", "#D55E00"
COLUMNS = 3
_WINDOW_M = 6.0  # shown around the true trajectory, so that a diverged one does not shrink it
_CIRCLE = np.stack([f(np.linspace(0.0, 2.0 * np.pi, 73)) for f in (np.cos, np.sin)])


def plot_maps(maps: Sequence[tuple[str, Estimate, Truth]], path: str | Path) -> None:
    """Draw maps of (title, estimate, truth) side by side into an image file.

    Trajectories are lines, objects their outlines from above. A true object that is no ellipsoid
    is a circle of its volume, a mapped one that is none a cross.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not maps:
        raise ValueError("there are no maps to draw")
    columns = min(COLUMNS, len(maps))
    rows = -(-len(maps) // columns)
    figure = Figure(figsize=(4.4 * columns, 3.6 * rows + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, (title, estimate, truth) in zip(grid.flat, maps, strict=False):
        _draw_map(axes, estimate, truth)
        axes.set_title(title, fontsize=10)
    for axes in grid.flat[len(maps) :]:
        axes.set_axis_off()
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    figure.savefig(path, dpi=150)


def _draw_map(axes: "Axes", estimate: Estimate, truth: Truth) -> None:
    _draw_path(axes, estimate.initial_poses, ODOMETRY, "odometry", 1.2)
    _draw_path(axes, truth.poses, TRUTH, "truth", 2.6)
    _draw_path(axes, estimate.poses, ESTIMATE, "estimate", 1.2)
    for outline in _true_outlines(truth):
        axes.fill(*outline, facecolor=TRUTH, alpha=0.35, edgecolor=TRUTH, linewidth=1.0)
    for center, shape, real in zip(
        estimate.centers, estimate.shapes, estimate.is_ellipsoid, strict=True
    ):
        if real:
            axes.plot(*_outline(center, shape), color=ESTIMATE, linewidth=1.4)
        else:
            axes.plot(*center[:2], "x", color=ESTIMATE, markersize=5)
    _frame(axes, truth.poses[:, :2], np.vstack([estimate.initial_poses, estimate.poses])[:, :2])


def _draw_path(axes: "Axes", poses: Floats, color: str, label: str, width: float) -> None:
    axes.plot(*poses[:, :2].T, color=color, label=label, linewidth=width, solid_capstyle="round")


def _frame(axes: "Axes", true_places: Floats, places: Floats) -> None:
    """Show all of the truth, and the rest as far as it stays near."""
    low, high = true_places.min(axis=0) - _WINDOW_M, true_places.max(axis=0) + _WINDOW_M
    axes.set_xlim(max(low[0], places[:, 0].min() - 1.0), min(high[0], places[:, 0].max() + 1.0))
    axes.set_ylim(max(low[1], places[:, 1].min() - 1.0), min(high[1], places[:, 1].max() + 1.0))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")
    axes.grid(alpha=0.25, linewidth=0.5)


def _true_outlines(truth: Truth) -> list[Floats]:
    """Return the outlines of the true objects from above, each (2, n), metres."""
    if truth.ellipsoids is None:
        radii = np.cbrt(0.75 / np.pi * truth.volume)
        shapes = radii[:, None, None] ** 2 * np.eye(3)
    else:
        quadrics = [_core.dual_quadric_from_ellipsoid(row) for row in truth.ellipsoids]
        shapes = quadric_shapes(np.array(quadrics))
    return [_outline(*one) for one in zip(truth.center, shapes, strict=True)]


def _outline(center: Floats, shape: Floats) -> Floats:
    """Return the outline from above, (2, n), of an ellipsoid: an ellipse of shape S_xy."""
    return np.asarray(center[:2, None] + np.linalg.cholesky(shape[:2, :2]) @ _CIRCLE)
