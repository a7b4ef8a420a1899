"""The figure of the planar degeneracy."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dqslam.plot.style import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    VERMILLION,
    new_figure,
    save_figure,
)
from dqslam.studies.degeneracy import ESTIMATORS, STARTS, DegeneracyTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DPI = 110
_MOTION_COLORS = (BLUE, ORANGE, GREEN, PURPLE)
_ESTIMATOR_COLORS = {"paper": VERMILLION, "dqslam": BLUE}
_START_MARKERS = {"SVD": "s", "identity": "D", "sphere": "o"}
_ZERO = 1e-9  # values that are zero except for rounding are drawn here


def plot_degeneracy(table: DegeneracyTable, path: str | Path) -> None:
    """Draw the singular values of each motion, and the errors of each estimator and start."""
    figure = new_figure(10.5, 4.2)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.2))
    _draw_singular_values(left, table)
    _draw_errors(right, table)
    save_figure(figure, path, dpi=_DPI)


def _draw_singular_values(axes: "Axes", table: DegeneracyTable) -> None:
    for row, color, marker in zip(table.motions, _MOTION_COLORS, "v^os", strict=True):
        values = np.maximum(row.singular_values, _ZERO)
        axes.semilogy(
            np.arange(1, 11), values, color=color, marker=marker, markersize=5, label=row.motion
        )
    axes.axhline(_ZERO, color="0.6", linewidth=0.8, linestyle=":")
    axes.annotate("exactly 0", (1.0, 1.3 * _ZERO), color="0.4", fontsize=9)
    axes.set(xlabel="number", ylabel="singular value / largest", xticks=range(1, 11))
    axes.set_title("How well the boxes determine a dual quadric", fontsize=10)
    axes.grid(alpha=0.25, linewidth=0.5)
    axes.legend(frameon=False, fontsize=9, loc="center left")


def _draw_errors(axes: "Axes", table: DegeneracyTable) -> None:
    names = [row.motion for row in table.motions]
    methods = [(estimator, start) for estimator in ESTIMATORS for start in STARTS]
    for place, (estimator, start) in enumerate(methods):
        rows = [row for row in table.rows if (row.estimator, row.start) == (estimator, start)]
        low, median, high = np.array([row.center_error_m for row in rows]).T
        axes.errorbar(
            np.arange(len(names)) + 0.12 * (place - (len(methods) - 1) / 2.0),
            median,
            yerr=[median - low, high - median],
            color=_ESTIMATOR_COLORS[estimator],
            marker=_START_MARKERS[start],
            markerfacecolor="white" if start == "identity" else None,
            markersize=5,
            linestyle="none",
            elinewidth=1.0,
            label=f"{estimator}, {start} start",
        )
    axes.set_yscale("log")
    axes.set_ylim(top=1e8)  # larger errors all mean that the object is lost
    axes.set_xticks(range(len(names)), [name.replace(", ", ",\n") for name in names])
    axes.set_ylabel("error of the object's center [m]")
    axes.set_title(f"Median and quartiles of {table.trials} objects, poses known", fontsize=10)
    axes.grid(alpha=0.25, linewidth=0.5, axis="y")
    axes.legend(frameon=False, fontsize=9, loc="upper right")
