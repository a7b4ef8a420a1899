"""Detected and re-projected boxes, in the frame that fits worst and in the median frame."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dqslam._colors import object_colors
from dqslam.evaluation import BoxFits
from dqslam.io import Results
from dqslam.metrics import projected_edges, visible_outlines
from dqslam.plot.frame import draw_boxes, rectangle
from dqslam.plot.labels import place_labels
from dqslam.plot.style import (
    COLUMN_INCHES,
    GRAY,
    column_style,
    new_figure,
    shown_name,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_AROUND = 0.03  # margin on each side, share of the image
_TALLEST = 3.0  # largest height of an image, inches


def draw_worst_and_median(results: Results, fits: BoxFits) -> "Figure":
    """Draw the frame with the least mean overlap of boxes and objects, and the median frame.

    Detected boxes are solid, boxes of the objects are dashed, and outlines of the objects are
    thin. Pixels are undistorted.
    """
    poses, overlaps = fits.frames()
    if not len(poses):
        raise ValueError(f"{results.directory}: no box shows an object of the map")
    chosen = list(dict.fromkeys([0, len(poses) // 2]))
    names = ("worst", "median")
    camera = results.camera
    colors = object_colors(results.objects.class_names)
    height = min(COLUMN_INCHES * camera.height / camera.width, _TALLEST)
    with column_style():
        figure = new_figure(COLUMN_INCHES, (height + 0.22) * len(chosen) + 0.25)
        grid = figure.subplots(len(chosen), 1, squeeze=False)[:, 0]
        for axes, place, name in zip(grid, chosen, names, strict=False):
            pose = int(poses[place])
            axes.set_title(
                f"{name}: pose {pose}, mean IoU {overlaps[place]:.2f}",
                loc="left",
                x=_AROUND / (1.0 + 2.0 * _AROUND),  # where the image begins
                pad=2.0,
            )
            _frame(axes, camera.width, camera.height)
            _draw(axes, results, fits, pose, colors)
        _draw_legend(figure, fits, poses[chosen].tolist())
        for axes, place in zip(grid, chosen, strict=True):
            _name(axes, results, fits, int(poses[place]), colors)
    return figure


def _frame(axes: "Axes", width: int, height: int) -> None:
    axes.plot(
        *rectangle(np.array([-0.5, -0.5, width - 0.5, height - 0.5])), color="0.6", linewidth=0.5
    )
    axes.set(
        xlim=(-_AROUND * width, (1.0 + _AROUND) * width),
        ylim=((1.0 + _AROUND) * height, -_AROUND * height),
        aspect="equal",
        xticks=[],
        yticks=[],
    )
    for spine in axes.spines.values():
        spine.set_visible(False)


def _draw(axes: "Axes", results: Results, fits: BoxFits, pose: int, colors: Sequence[str]) -> None:
    detected = draw_boxes(axes, results, fits, pose, colors, lens=False, linewidth=1.0)
    here, solids = results.poses[pose], results.objects.solids
    rows, outlines = visible_outlines(results.camera, here, solids)
    for row, outline in zip(rows, outlines, strict=True):
        if row not in detected:
            continue
        color = colors[row]
        axes.plot(*outline.T, color=color, linewidth=0.5, gid="outline")
        for edge in projected_edges(results.camera, here, solids, int(row)):
            axes.plot(*edge.T, color=color, linewidth=0.25, gid="edge")
        box = np.concatenate([outline.min(axis=0), outline.max(axis=0)])
        axes.plot(
            *rectangle(box), color=color, linewidth=0.8, linestyle=(0, (3, 1.5)), gid="re-projected"
        )


def _name(axes: "Axes", results: Results, fits: BoxFits, pose: int, colors: Sequence[str]) -> None:
    rows = np.flatnonzero((fits.boxes.pose == pose) & (fits.object_row >= 0))
    objects = results.objects
    seen = fits.object_row[rows]
    place_labels(
        axes,
        [rectangle(fits.boxes.box[row]) for row in rows],
        [f"{shown_name(objects.class_names[row])} {objects.object_ids[row]}" for row in seen],
        [colors[row] for row in seen],
        size=5.5,
    )


def _draw_legend(figure: "Figure", fits: BoxFits, poses: list[int]) -> None:
    from matplotlib.lines import Line2D

    here = np.isin(fits.boxes.pose, poses)
    handles = [
        Line2D([], [], color="0.2", linewidth=1.0, label="detected"),
        Line2D([], [], color="0.2", linewidth=0.8, linestyle=(0, (3, 1.5)), label="re-projected"),
        Line2D([], [], color="0.2", linewidth=0.5, label="object"),
    ]
    if (here & fits.boxes.held_out).any():
        handles.insert(1, Line2D([], [], color="0.2", linestyle=":", label="held out"))
    if (here & (fits.object_row < 0)).any():
        handles.append(Line2D([], [], color=GRAY, label="not in the map"))
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=len(handles),
        frameon=False,
        borderpad=0.1,
        handlelength=1.3,
        columnspacing=0.8,
    )
