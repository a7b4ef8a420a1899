"""Errors of the poses over time, with the uncertainty of the estimate."""

from typing import TYPE_CHECKING, Literal

import numpy as np

from dqslam._checks import Floats
from dqslam.evaluation import PoseErrors
from dqslam.plot.gaps import break_at_gaps
from dqslam.plot.style import (
    COLUMN_INCHES,
    ESTIMATE,
    ODOMETRY,
    SKY,
    column_style,
    legend_above,
    new_figure,
    say_frame,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIGMAS = 3.0
_NOTHING = 1e-9  # a planar robot has no error along the vertical


def draw_errors(errors: PoseErrors, kind: Literal["position", "rotation"]) -> "Figure":
    """Draw the errors along each axis of the true world, and the band of 3 sigma around zero.

    Positions are in meters, rotations in degrees. For positions, also draw the distances of the
    estimate and of odometry from the truth after alignment. An axis without any error is left out.
    """
    seconds = errors.timestamps - errors.timestamps[0]
    values, sigmas = errors.position, errors.position_sigma
    if kind == "rotation":
        values, sigmas = np.degrees(errors.rotation), np.degrees(errors.rotation_sigma)
    shown = [axis for axis in range(3) if np.abs(values[:, axis]).max() > _NOTHING]
    distance = kind == "position"
    with column_style():
        count = max(len(shown), 1) + distance
        figure = new_figure(COLUMN_INCHES, 0.55 + 0.8 * count + 0.12 * (1 + distance))
        grid = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
        if distance:
            _draw_distance(grid[0], seconds, errors)
        for axes, axis in zip(grid[int(distance) :], shown, strict=False):
            _draw_axis(axes, seconds, values[:, axis], sigmas[:, axis])
            axes.set_ylabel(f"{'xyz'[axis]} [m]" if distance else f"about {'xyz'[axis]} [°]")
        if distance:
            say_frame(grid[0], "after alignment")
        if count > distance:
            say_frame(
                grid[int(distance)], "along the axes of the true world, from equal first poses"
            )
        for axes in grid:
            axes.grid(alpha=0.25, linewidth=0.4)
            axes.margins(x=0.01)
        grid[-1].set_xlabel("time [s]")
        figure.align_ylabels(grid)
        _draw_legend(figure, has_band=bool(np.isfinite(sigmas).any()), has_odometry=distance)
    return figure


def _draw_distance(axes: "Axes", seconds: Floats, errors: PoseErrors) -> None:
    odometry, estimate = (
        break_at_gaps(seconds, values) for values in (errors.odometry_distance, errors.distance)
    )
    axes.plot(*odometry, color=ODOMETRY, linewidth=0.8, gid="odometry")
    axes.plot(*estimate, color=ESTIMATE, linewidth=0.9, gid="estimate")
    axes.set_ylabel("distance [m]")
    axes.set_ylim(bottom=0.0)


def _draw_axis(axes: "Axes", seconds: Floats, values: Floats, sigmas: Floats) -> None:
    known = np.isfinite(sigmas)
    band = _SIGMAS * sigmas[known]
    axes.fill_between(seconds[known], -band, band, color=SKY, alpha=0.35, linewidth=0, gid="band")
    axes.axhline(0.0, color="0.4", linewidth=0.5)
    axes.plot(*break_at_gaps(seconds, values), color=ESTIMATE, linewidth=0.9, gid="estimate")
    reach = 1.1 * max(np.abs(values).max(), band.max(initial=0.0), 1e-12)
    axes.set_ylim(-reach, reach)


def _draw_legend(figure: "Figure", *, has_band: bool, has_odometry: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [Line2D([], [], color=ESTIMATE, label="estimate")]
    if has_odometry:
        handles.insert(0, Line2D([], [], color=ODOMETRY, linewidth=0.8, label="odometry"))
    if has_band:
        handles.append(Patch(color=SKY, alpha=0.35, linewidth=0, label="3σ"))
    legend_above(figure, handles)
