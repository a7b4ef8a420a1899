"""Residuals of boxes compared with the noise model."""

from typing import TYPE_CHECKING

import numpy as np

from dqslam._checks import Floats
from dqslam.evaluation import BoxFits
from dqslam.plot.style import (
    COLUMN_INCHES,
    GRAY,
    ORANGE,
    SKY,
    column_style,
    legend_above,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_EDGES = 4
_GATE = 0.99  # share of the inliers below the line
_LARGEST_CHI2, _LARGEST_SIGMA = 20.0, 5.0


def draw_residuals(fits: BoxFits) -> "Figure":
    """Draw histograms of boxes with the density of chi-square, and of edges with a Gaussian.

    Chi-square has 4 degrees of freedom; boxes that the image border cuts are left out. Values
    beyond an end of the axis are in the last bin, which is hatched. Boxes that were held out from
    the estimator have a separate line.
    """
    from scipy.stats import chi2, norm

    held_out, uncut = fits.boxes.held_out, fits.is_uncut
    with column_style():
        figure = new_figure(COLUMN_INCHES, 2.0)
        left, right = figure.subplots(1, 2)
        bins = np.linspace(0.0, _LARGEST_CHI2, 21)
        _draw_histogram(left, fits.chi2[uncut & ~held_out], fits.chi2[uncut & held_out], bins)
        x = np.linspace(0.0, _LARGEST_CHI2, 200)
        left.plot(x, chi2.pdf(x, _EDGES), color="black", label="χ², 4 dof", gid="expected")
        gate = float(chi2.ppf(_GATE, _EDGES))
        left.axvline(gate, color="0.4", linewidth=0.6, linestyle=":")
        left.annotate(
            "99 %", (gate, 1.0), (2, -2), xycoords=("data", "axes fraction"),
            textcoords="offset points", va="top", fontsize=6.0, color="0.3",
        )  # fmt: skip
        left.set(xlabel="χ² of a box", ylabel="density", xlim=(0.0, _LARGEST_CHI2))
        known = np.isfinite(fits.residual)
        bins = np.linspace(-_LARGEST_SIGMA, _LARGEST_SIGMA, 21)
        _draw_histogram(
            right,
            fits.residual[known & ~held_out[:, None]],
            fits.residual[known & held_out[:, None]],
            bins,
        )
        x = np.linspace(-_LARGEST_SIGMA, _LARGEST_SIGMA, 200)
        right.plot(x, norm.pdf(x), color="black", label="expected", gid="expected")
        right.set(xlabel="residual of an edge [σ]", xlim=(-_LARGEST_SIGMA, _LARGEST_SIGMA))
        for axes in (left, right):
            axes.grid(alpha=0.25, linewidth=0.4)
        _draw_legend(figure, any_held_out=bool((held_out & uncut).any()))
    return figure


def _draw_histogram(axes: "Axes", used: Floats, held_out: Floats, bins: Floats) -> None:
    width = bins[1] - bins[0]
    inside = (bins[0] + 0.5 * width, bins[-1] - 0.5 * width)
    if used.size:
        density, _ = np.histogram(used.clip(*inside), bins, density=True)
        bars = axes.bar(
            bins[:-1], density, width, align="edge", facecolor=SKY, edgecolor="white",
            linewidth=0.4, gid="used",
        )  # fmt: skip
        beyond = [bars[-1]] if bins[0] == 0.0 else [bars[0], bars[-1]]
        for bar in beyond:
            bar.set(facecolor=(SKY, 0.5), hatch="/////", edgecolor=GRAY)
    if held_out.size:
        density, _ = np.histogram(held_out.clip(*inside), bins, density=True)
        axes.stairs(density, bins, color=ORANGE, linewidth=1.0, gid="held out")


def _draw_legend(figure: "Figure", *, any_held_out: bool) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [
        Patch(facecolor=SKY, label="boxes used"),
        Patch(facecolor=(SKY, 0.5), hatch="/////", edgecolor=GRAY, linewidth=0, label="beyond"),
        Line2D([], [], color="black", label="expected"),
    ]
    if any_held_out:
        handles.insert(1, Line2D([], [], color=ORANGE, label="held out"))
    legend_above(figure, handles)
