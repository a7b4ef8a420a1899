"""The map of a directory of results, seen from above."""

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Floats
from dqslam._colors import class_colors, is_colored_by_object, object_colors
from dqslam.io import MapObjects, Results, TrueObjects
from dqslam.metrics import Alignment
from dqslam.plot.above import FromAbove, from_above, outline
from dqslam.plot.gaps import break_at_gaps
from dqslam.plot.labels import place_labels
from dqslam.plot.style import (
    COLUMN_INCHES,
    ESTIMATE,
    GRAY,
    ODOMETRY,
    TRUTH,
    column_style,
    new_figure,
    say_frame,
    shown_name,
)
from dqslam.plot.tracks import TRACK, TRACK_TAB, draw_tracks, track_ends

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIGMAS = 2.0
_POSE_ELLIPSES = 12
IN_TRUTH = "from above, in the world of the truth, estimate aligned"
_NAMED_BY_CLASS = 12  # with more objects, labels are numbers, and the legend has the classes
WIDTH_INCHES = 2.8  #: of the map, without its axis
_RATIOS = (0.35, 1.35)  # least and largest ratio of its height to its width
_LEGEND_COLUMNS = 4
_MARGIN = 0.06  # margin, share of the size
_LOST = 0.5  # largest share of the size that odometry and objects add to each side of the paths
_ODOMETRY_PATH: dict[str, Any] = {"color": ODOMETRY, "linewidth": 0.8, "label": "odometry"}
_ESTIMATED_PATH: dict[str, Any] = {"color": ESTIMATE, "linewidth": 0.9, "label": "estimate"}
_TRUE_PATH: dict[str, Any] = {"color": TRUTH, "linewidth": 2.4, "alpha": 0.5, "label": "truth"}


@dataclass(frozen=True, eq=False)
class MapTruth:
    """The truth in its own world, and the motion that moves the estimate into it."""

    timestamps: Floats
    """Times of the poses, seconds, shape (n,)."""
    world_from_camera: Floats
    """True poses, shape (n, 7)."""
    objects: TrueObjects | None
    alignment: Alignment
    """true_from_estimated."""


def draw_results_map(results: Results, truth: MapTruth | None = None) -> "Figure":
    """Draw odometry, estimate, objects by class, uncertainty of 2 sigma, and the truth if known.

    With a truth, everything is in its world, and the same motion moves odometry and estimate.
    Objects are outlines from above. Covariances of their centers are dotted. An object that is no
    ellipsoid is a cross.
    """
    move = Alignment(np.eye(3), np.zeros(3)) if truth is None else truth.alignment
    estimate, odometry = (
        move.apply_poses(poses) for poses in (results.poses, results.initial_poses)
    )
    view = from_above(estimate if truth is None else truth.world_from_camera)
    colors = object_colors(results.objects.class_names)
    true_outlines = [] if truth is None else _true_outlines(view, truth.objects)
    outlines = _outlines(view, results.objects, move)
    paths = [view.points(estimate[:, :3])]
    if truth is not None:
        paths.append(view.points(truth.world_from_camera[:, :3]))
    low, high = window(paths, [view.points(odometry[:, :3]), *(o.T for o in outlines)])
    with column_style():
        width, height = high - low
        entries = _legend_entries(results, truth)
        rows = -(-len(entries) // _LEGEND_COLUMNS)
        figure = new_figure(
            COLUMN_INCHES, WIDTH_INCHES * float(height / width) + 0.54 + 0.14 * rows
        )
        axes = figure.subplots()
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        view.set_up(axes)
        say_frame(axes, "from above, in the world of the odometry" if truth is None else IN_TRUTH)
        if truth is not None:
            axes.plot(*_true_path(view, truth).T, gid="truth", **_TRUE_PATH)
        axes.plot(*view.points(odometry[:, :3]).T, gid="odometry", **_ODOMETRY_PATH)
        axes.plot(*view.points(estimate[:, :3]).T, gid="estimate", **_ESTIMATED_PATH)
        axes.plot(*view.points(estimate[:1, :3]).T, "o", color="black", markersize=2.5, zorder=3)
        _draw_pose_ellipses(axes, view, results, estimate, move.scale)
        for one in true_outlines:
            axes.fill(*one, facecolor=TRUTH, alpha=0.35, linewidth=0, zorder=1.5)
        _draw_objects(axes, view, results.objects, move, outlines, colors)
        draw_tracks(axes, view, results.tracks, move)
        _draw_legend(figure, entries)
        place_labels(
            axes,
            [*outlines, *track_ends(view, results.tracks, move)],
            [*_names(results.objects), *(f"T{track.track_id}" for track in results.tracks)],
            [*colors, *[TRACK_TAB] * len(results.tracks)],
            size=6.0 if len(outlines) <= _NAMED_BY_CLASS else 5.0,
        )
    return figure


def window(paths: list[Floats], others: list[Floats]) -> tuple[Floats, Floats]:
    """Return the corners (2,) of the window, with the paths and everything near them."""
    every = np.vstack(paths)
    low, high = every.min(axis=0), every.max(axis=0)
    beyond = _LOST * max(float((high - low).max()), 1e-3)
    near_low, near_high = low - beyond, high + beyond
    for points in others:
        low = np.minimum(low, points.min(axis=0).clip(min=near_low))
        high = np.maximum(high, points.max(axis=0).clip(max=near_high))
    low, high = low - _MARGIN * (high - low).max(), high + _MARGIN * (high - low).max()
    width, height = high - low
    wanted = np.array(
        [max(width, height / _RATIOS[1]), max(height, width * _RATIOS[0])], dtype=float
    )
    wider = (wanted - (high - low)) / 2.0
    return low - wider, high + wider


def _true_path(view: FromAbove, truth: MapTruth) -> Floats:
    """Return the true path (n, 2), with a point of NaN in each gap."""
    return break_at_gaps(truth.timestamps, view.points(truth.world_from_camera[:, :3]))[1]


def _outlines(view: FromAbove, objects: MapObjects, move: Alignment) -> list[Floats]:
    """Return the outline of each object (2, n), or its center (2, 1) if it is no ellipsoid."""
    return view.solid_outlines(objects.solids.moved(move.rotation, move.translation, move.scale))


def _true_outlines(view: FromAbove, objects: TrueObjects | None) -> list[Floats]:
    """Return the inscribed ellipsoids of true objects; those without a size are points."""
    if objects is None or objects.size is None:
        return []
    turns = np.tile(np.eye(3), (len(objects), 1, 1))
    if objects.rotation is not None:
        turns = objects.rotation
    axes = turns * (0.5 * objects.size[:, None])
    shapes = axes @ axes.swapaxes(1, 2)
    pairs = zip(objects.center[objects.static], shapes[objects.static], strict=True)
    return [view.outline(center, shape) for center, shape in pairs]


def _turns(xyzw: Floats) -> Floats:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(xyzw).as_matrix())


def _draw_pose_ellipses(
    axes: "Axes", view: FromAbove, results: Results, estimate: Floats, scale: float
) -> None:
    known = np.flatnonzero(np.isfinite(results.covariances).all(axis=(1, 2)))
    if not known.size:
        return
    evenly = np.unique(np.linspace(0, len(known) - 1, _POSE_ELLIPSES + 1).astype(int)[1:])
    for row in known[evenly]:
        turn = _turns(estimate[row, 3:])
        spread = (_SIGMAS * scale) ** 2 * turn @ results.covariances[row, :3, :3] @ turn.T
        axes.plot(
            *view.outline(estimate[row, :3], spread),
            color=ESTIMATE,
            linewidth=0.5,
            linestyle=":",
            gid="pose covariance",
        )


def _draw_objects(
    axes: "Axes",
    view: FromAbove,
    objects: MapObjects,
    move: Alignment,
    outlines: list[Floats],
    colors: list[str],
) -> None:
    for row, one in enumerate(outlines):
        color = colors[row]
        if one.shape[1] == 1:
            axes.plot(*one, "x", color=color, markersize=4, gid="object")
            continue
        axes.fill(*one, facecolor=color, alpha=0.25, linewidth=0, zorder=2.5)
        axes.plot(*one, color=color, linewidth=0.9, zorder=2.6, gid="object")
        covariance = objects.center_covariances[row]
        if np.isfinite(covariance).all():
            turned = _SIGMAS**2 * move.scale**2 * move.rotation @ covariance @ move.rotation.T
            (center,) = move.apply(objects.centers[[row]])
            flat = view.axes @ turned @ view.axes.T
            axes.plot(
                *outline(view.axes @ center, flat),
                color="0.2",
                linewidth=0.5,
                linestyle=":",
                zorder=2.7,
                gid="object covariance",
            )


def _legend_entries(results: Results, truth: MapTruth | None) -> list[Any]:
    """Return what the legend explains: paths and marks that are drawn, then the classes."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    objects = results.objects
    entries: list[Any] = [Line2D([], [], **_ODOMETRY_PATH), Line2D([], [], **_ESTIMATED_PATH)]
    if truth is not None:
        entries.append(Line2D([], [], **_TRUE_PATH))
    entries.append(Line2D([], [], color="black", marker="o", markersize=2.5, lw=0, label="start"))
    if results.tracks:
        entries.append(Line2D([], [], label="what moves", **TRACK))
    if (
        np.isfinite(results.covariances).any()
        or np.isfinite(results.objects.center_covariances).any()
    ):
        entries.append(Line2D([], [], color="0.2", linewidth=0.6, linestyle=":", label="2σ"))
    if truth is not None and truth.objects is not None and truth.objects.size is not None:
        entries.append(Patch(facecolor=TRUTH, alpha=0.35, linewidth=0, label="true object"))
    if not objects.is_ellipsoid.all():
        cross = Line2D([], [], color="0.2", marker="x", markersize=4, lw=0, label="no ellipsoid")
        entries.append(cross)
    colors = class_colors(objects.class_names)
    if is_colored_by_object(objects.class_names):
        colors = dict.fromkeys(colors, GRAY)  # each object has a color of its own
    entries += [
        Patch(facecolor=(color, 0.25), edgecolor=color, label=shown_name(name))
        for name, color in colors.items()
    ]
    return entries


def _draw_legend(figure: "Figure", entries: list[Any]) -> None:
    """Draw the legend below, in rows."""
    from matplotlib.lines import Line2D

    blank = Line2D([], [], linewidth=0.0, label=" ")
    filled = entries + [blank] * (-len(entries) % _LEGEND_COLUMNS)
    by_column = [one for at in range(_LEGEND_COLUMNS) for one in filled[at::_LEGEND_COLUMNS]]
    figure.legend(
        handles=by_column,
        loc="outside lower center",
        ncols=_LEGEND_COLUMNS,
        frameon=False,
        borderpad=0.1,
        labelspacing=0.3,
    )


def _names(objects: MapObjects) -> list[str]:
    """Return the label of each object: its class, and its id if the class is not unique."""
    if len(objects) > _NAMED_BY_CLASS:
        return [str(number) for number in objects.object_ids]
    count = Counter(objects.class_names)
    pairs = zip(objects.class_names, objects.object_ids, strict=True)
    return [
        shown_name(name) if count[name] == 1 else f"{shown_name(name)} {number}"
        for name, number in pairs
    ]
