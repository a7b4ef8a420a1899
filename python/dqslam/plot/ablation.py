"""The figure of the ablation."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dqslam._checks import Floats
from dqslam.plot.style import BLUE, VERMILLION, new_figure, save_figure
from dqslam.studies.ablation import WRONG_KINDS, WRONG_SHARE, AblationTable, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DPI = 110
_KIND_STYLES = {"random": (BLUE, "o"), "structured": (VERMILLION, "s")}
_WORST_SHOWN = 100.0  # the largest error over bound that has a color of its own


def plot_ablation(table: AblationTable, path: str | Path) -> None:
    """Draw the variants with right ids as two tables, and below the losses with wrong ids."""
    figure = new_figure(11.0, 6.6)
    grid = figure.add_gridspec(2, 2)
    clean = [row for row in table.rows if row.variant.wrong_ids is None]
    _draw_map(
        figure.add_subplot(grid[0, 0]),
        clean,
        np.array([row.optimum_rate for row in clean]),
        title=f"optimum reached, share of {table.trials} trials",
        limits=(0.0, 1.0),
        colors="RdYlGn",
    )
    _draw_map(
        figure.add_subplot(grid[0, 1]),
        clean,
        np.array([row.error_over_bound for row in clean]),
        title="mean error of the poses / posterior bound",
        limits=(1.0, _WORST_SHOWN),
        colors="RdYlGn_r",
    )
    _draw_back_ends(figure.add_subplot(grid[1, :]), table)
    save_figure(figure, path, dpi=_DPI)


def label(name: str) -> str:
    """Return the name of an option's value in words."""
    words = name.lower().replace("_", " ").replace("then", "→")
    for lower in ("svd", "dcs", "gnc tls", "gnc gm"):
        words = words.replace(lower, lower.upper())
    return words.replace("huber", "Huber").replace("cauchy", "Cauchy")


def _draw_map(
    axes: "Axes",
    rows: list[Row],
    values: Floats,
    *,
    title: str,
    limits: tuple[float, float],
    colors: str,
) -> None:
    """Draw a table of numbers with a row per residual and a column per schedule and start."""
    from matplotlib.colors import LogNorm, Normalize

    down = list(dict.fromkeys(row.variant.residual for row in rows))
    across = sorted(
        dict.fromkeys((row.variant.schedule, row.variant.start) for row in rows),
        key=lambda part: (part[0].value, part[1].value),
    )
    numbers = np.full((len(down), len(across)), np.nan)
    for row, value in zip(rows, values, strict=True):
        place = across.index((row.variant.schedule, row.variant.start))
        numbers[down.index(row.variant.residual), place] = value
    norm = (Normalize if limits[0] == 0.0 else LogNorm)(*limits, clip=True)
    axes.imshow(numbers, norm=norm, cmap=colors, aspect="auto", alpha=0.6)
    for (at_row, at_column), number in np.ndenumerate(numbers):
        text = "failed" if np.isnan(number) else f"{number:.2f}" if number < 10 else f"{number:.0f}"
        axes.text(at_column, at_row, text, ha="center", va="center", fontsize=8)
    starts = [f"{label(schedule.name)}\n{label(start.name)}" for schedule, start in across]
    axes.set_xticks(range(len(across)), starts, fontsize=8)
    axes.set_yticks(range(len(down)), [label(residual.name) for residual in down], fontsize=8)
    axes.tick_params(length=0)
    axes.set_title(title, fontsize=10)


def _draw_back_ends(axes: "Axes", table: AblationTable) -> None:
    names: list[str] = []
    for side, kind in zip((-0.12, 0.12), WRONG_KINDS, strict=True):
        rows = [row for row in table.rows if row.variant.wrong_ids == kind]
        names = ["oracle" if row.variant.oracle else label(row.variant.loss.name) for row in rows]
        ratio = np.array([row.error_over_bound for row in rows])
        color, marker = _KIND_STYLES[kind]
        place = np.arange(len(rows)) + side
        axes.plot(place, ratio, marker, color=color, label=f"{kind} wrong ids")
        for x, y in zip(place, ratio, strict=True):
            text, up = f"{y:.2f}" if y < 10.0 else f"{y:.0f}", (6.0 * np.sign(side), 0.0)
            where = "left" if side > 0 else "right"
            axes.annotate(
                text,
                (x, y),
                up,
                textcoords="offset points",
                ha=where,
                va="center",
                fontsize=8,
                color=color,
            )
    axes.axhline(1.0, color="0.4", linewidth=0.8, linestyle=":")
    axes.set_yscale("log")
    axes.set_xticks(range(len(names)), names, fontsize=9)
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_ylabel("mean error / bound")
    axes.set_title(f"robust losses, {WRONG_SHARE:.0%} of the boxes with a wrong id", fontsize=10)
    axes.grid(alpha=0.25, linewidth=0.5, axis="y")
    axes.legend(frameon=False, fontsize=9, loc="upper right")
