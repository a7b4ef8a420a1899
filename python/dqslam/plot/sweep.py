"""Figures of a sweep: metrics against a varied setting, with confidence intervals."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Floats
from dqslam._files import FileError
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
_LOG_FROM = 20.0  # an axis is logarithmic if its values differ by this factor or more
_MOST_SERIES = 6
_APART = 0.012  # share of the axis between the points of two series
# The metrics that are drawn if they were measured. Without these, the first two are drawn.
_SHOWN = {"rmse_pos": "positions", "rmse_landmark": "centers"}


@dataclass(frozen=True)
class _Places:
    """Places of a parameter's values on the axis. Values that are no numbers are side by side."""

    names: list[str] | None
    in_decades: bool
    span: float
    """Length of the axis, in logarithms if it is in decades."""
    series: int

    @classmethod
    def of(cls, values: list[Any], series: int) -> _Places:
        if not all(isinstance(one, int | float) and not isinstance(one, bool) for one in values):
            names = list(dict.fromkeys(map(str, values)))
            return cls(names, False, float(len(names)), series)
        low, high = float(min(values)), float(max(values))
        in_decades = low > 0.0 and high >= _LOG_FROM * low
        return cls(None, in_decades, np.log(high / low) if in_decades else high - low, series)

    def at(self, values: list[Any], number: int) -> Floats:
        """Return the places for the values of a series, beside those of the other series."""
        shift = _APART * self.span * (number - (self.series - 1) / 2.0)
        if self.names is not None:
            return np.array([self.names.index(str(one)) for one in values]) + 4.0 * shift
        x = np.array(values, dtype=float)
        return x * np.exp(shift) if self.in_decades else x + shift


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
    """Draw the median of each metric against a parameter, by default the first.

    A series has all cells with equal values of the other parameters, and is drawn as a line. More
    than six series are drawn as one series of points. Bars are confidence intervals of the medians.

    Raises
    ------
    ValueError
        If the parameter was not varied.
    """
    parameters = summary["parameters"]
    parameter = parameters[0] if parameter is None else parameter
    if parameter not in parameters:
        raise ValueError(f"{parameter} was not varied; varied were {', '.join(parameters)}")
    metrics = [name for name in _SHOWN if name in summary["units"]] or list(summary["units"])[:2]
    others = [name for name in parameters if name != parameter]
    series: dict[str, list[dict[str, Any]]] = {}
    for cell in summary["cells"]:
        label = ", ".join(f"{_short(name)} {cell['values'][name]}" for name in others)
        series.setdefault(label, []).append(cell)
    is_cloud = len(series) > _MOST_SERIES
    if is_cloud:
        series = {"": summary["cells"]}
    with column_style():
        figure = new_figure(COLUMN_INCHES, 0.5 + 1.5 * len(metrics) + 0.14 * len(series))
        grid = figure.subplots(len(metrics), 1, sharex=True, squeeze=False)[:, 0]
        for axes, metric in zip(grid, metrics, strict=True):
            _draw_metric(axes, series, parameter, metric, is_cloud=is_cloud)
            unit = summary["units"][metric]
            name = _SHOWN.get(metric, metric.replace("_", " "))
            axes.set_ylabel(f"{name} [{unit}]" if unit else name)
            axes.grid(alpha=0.25, linewidth=0.4)
        grid[-1].set_xlabel(parameter)
        if len(series) > 1:
            handles, labels = grid[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", frameon=False, borderpad=0.1)
        title = f"median of {summary['trials']} trials, {summary['confidence']:.0%} intervals"
        grid[0].set_title(title, loc="left")
    return figure


def _draw_metric(
    axes: Axes,
    series: dict[str, list[dict[str, Any]]],
    parameter: str,
    metric: str,
    *,
    is_cloud: bool,
) -> None:
    every = [cell["values"][parameter] for cells in series.values() for cell in cells]
    place = _Places.of(every, len(series))
    low, high = np.inf, -np.inf
    for number, (label, cells) in enumerate(series.items()):
        found = [cell for cell in cells if metric in cell["metrics"]]
        if not found:
            continue
        x = place.at([cell["values"][parameter] for cell in found], number)
        spreads = [cell["metrics"][metric] for cell in found]
        median = np.array([spread["median"] for spread in spreads], dtype=float)
        bounds = np.array([_bounds(spread) for spread in spreads]).T
        order = np.argsort(x, kind="stable")
        joined = place.names is None and len(np.unique(x)) == len(x) and not is_cloud
        axes.errorbar(
            x[order],
            median[order],
            yerr=np.abs(bounds - median)[:, order],
            color=_COLORS[number % len(_COLORS)],
            marker=_MARKERS[number % len(_MARKERS)],
            markersize=3.0,
            linestyle="-" if joined else "none",
            linewidth=0.9,
            elinewidth=0.8,
            capsize=1.5,
            label=label,
        )
        low, high = min(low, float(bounds.min())), max(high, float(bounds.max()))
    if 0.0 < low < high / _LOG_FROM:
        axes.set_yscale("log")
    if place.in_decades:
        axes.set_xscale("log")
    if place.names is not None:
        axes.set_xticks(range(len(place.names)), place.names)
        axes.set_xlim(-0.5, len(place.names) - 0.5)


def _bounds(spread: dict[str, Any]) -> tuple[float, float]:
    """Return both ends of the median's interval, or the median twice if there is none."""
    interval = spread["median_interval"]
    if interval is None:
        return spread["median"], spread["median"]
    return interval[0], interval[1]


def _short(name: str) -> str:
    return name.rsplit(".", 1)[-1]
