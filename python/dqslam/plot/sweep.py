"""What a sweep shows: a metric against the setting that was varied, with confidence intervals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam.io import FileError
from dqslam.plot.style import (
    BLUE,
    COLUMN_INCHES,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    column_style,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUMMARY = "summary.json"
_COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
_MARKERS = "os^Dvp"
_LOG_FROM = 20.0  # times the least: so wide a range is drawn in decades
# What is drawn where nothing is asked for, as far as it was measured.
_SHOWN = ("rmse_pos", "rmse_landmark")


def read_summary(folder: Path) -> dict[str, Any]:
    """Read the summary of a sweep."""
    path = folder / SUMMARY
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        complete = all(name in content for name in ("parameters", "cells", "units", "confidence"))
        if not complete or not content["cells"] or not content["parameters"]:
            raise FileError(path, "is not the summary of a sweep with cells and parameters")
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror}") from None
    except json.JSONDecodeError as error:
        raise FileError(path, f"not JSON: {error.msg}", error.lineno) from None
    except TypeError:
        raise FileError(path, "holds no table of named values") from None
    return dict(content)


def draw_sweep(summary: dict[str, Any], parameter: str | None = None) -> Figure:
    """Draw the median of each metric against a parameter, the first by default, a line a series.

    A series is all cells that are alike in the other parameters. Bars are the confidence intervals
    of the medians.

    Raises
    ------
    ValueError
        For a parameter that was not varied.
    """
    parameters = summary["parameters"]
    parameter = parameters[0] if parameter is None else parameter
    if parameter not in parameters:
        raise ValueError(f"{parameter} was not varied; that were {', '.join(parameters)}")
    metrics = [name for name in _SHOWN if name in summary["units"]] or list(summary["units"])[:2]
    others = [name for name in parameters if name != parameter]
    series: dict[str, list[dict[str, Any]]] = {}
    for cell in summary["cells"]:
        label = ", ".join(f"{_short(name)} {cell['values'][name]}" for name in others)
        series.setdefault(label, []).append(cell)
    with column_style():
        figure = new_figure(COLUMN_INCHES, 0.5 + 1.5 * len(metrics) + 0.14 * len(series))
        grid = figure.subplots(len(metrics), 1, sharex=True, squeeze=False)[:, 0]
        for axes, metric in zip(grid, metrics, strict=True):
            _draw_metric(axes, series, parameter, metric)
            unit = summary["units"][metric]
            axes.set_ylabel(f"{metric} [{unit}]" if unit else metric)
            axes.grid(alpha=0.25, linewidth=0.4)
        grid[-1].set_xlabel(parameter)
        if others:
            handles, labels = grid[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", frameon=False, borderpad=0.1)
        title = f"median of {summary['trials']} trials, {summary['confidence']:.0%} intervals"
        grid[0].set_title(title, loc="left")
    return figure


def _draw_metric(
    axes: Axes, series: dict[str, list[dict[str, Any]]], parameter: str, metric: str
) -> None:
    every = [cell["values"][parameter] for cells in series.values() for cell in cells]
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in every)
    names = list(dict.fromkeys(map(str, every)))
    highest, lowest = 0.0, np.inf
    for place, (label, cells) in enumerate(series.items()):
        found = [cell for cell in cells if metric in cell["metrics"]]
        if not found:
            continue
        values = [cell["values"][parameter] for cell in found]
        x = np.array(values if numeric else [names.index(str(value)) for value in values], float)
        spreads = [cell["metrics"][metric] for cell in found]
        median = np.array([spread["median"] for spread in spreads], dtype=float)
        bounds = np.array([_bounds(spread) for spread in spreads]).T
        order = np.argsort(x, kind="stable")
        axes.errorbar(
            (x if numeric else x + 0.08 * (place - (len(series) - 1) / 2.0))[order],
            median[order],
            yerr=np.abs(bounds - median)[:, order],
            color=_COLORS[place % len(_COLORS)],
            marker=_MARKERS[place % len(_MARKERS)],
            markersize=3.0,
            linestyle="-" if numeric else "none",
            linewidth=0.9,
            elinewidth=0.8,
            capsize=1.5,
            label=label,
        )
        highest, lowest = max(highest, float(bounds.max())), min(lowest, float(bounds.min()))
    if 0.0 < lowest < highest / _LOG_FROM:
        axes.set_yscale("log")
    if not numeric:
        axes.set_xticks(range(len(names)), names)
    elif min(every) > 0 and max(every) >= _LOG_FROM * min(every):
        axes.set_xscale("log")


def _bounds(spread: dict[str, Any]) -> tuple[float, float]:
    """Return the ends of the interval of the median, itself where there is none."""
    interval = spread["median_interval"]
    if interval is None:
        return spread["median"], spread["median"]
    return interval[0], interval[1]


def _short(name: str) -> str:
    return name.rsplit(".", 1)[-1]
