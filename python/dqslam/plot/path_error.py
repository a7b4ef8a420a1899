"""The estimated path from above, in the color of its error."""

from typing import TYPE_CHECKING

import numpy as np

from dqslam._checks import Floats
from dqslam.plot.above import from_above
from dqslam.plot.gaps import break_at_gaps
from dqslam.plot.results_map import IN_TRUTH, WIDTH_INCHES, MapTruth, window
from dqslam.plot.style import (
    COLUMN_INCHES,
    TRUTH,
    column_style,
    legend_above,
    new_figure,
    say_frame,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_path_error(truth: MapTruth, positions: Floats, distance: Floats) -> "Figure":
    """Draw the path from above, each piece in the color of its distance from the truth.

    Parameters
    ----------
    truth
        The true poses (n, 7), and the motion that moves the estimate into their world.
    positions
        Estimated positions at the same times, in the world of the estimate, (n, 3) m.
    distance
        Absolute trajectory error of each pose, (n,) m. A piece has the mean of its two ends.
    """
    from matplotlib.collections import LineCollection

    view = from_above(truth.world_from_camera)
    true_path = view.points(truth.world_from_camera[:, :3])
    path = view.points(truth.alignment.apply(positions))
    low, high = window([true_path], [path])
    # Broken like the other paths, so that no piece bridges a gap in time.
    _, broken = break_at_gaps(truth.timestamps, np.column_stack([path, distance]))
    pieces = np.stack([broken[:-1], broken[1:]], axis=1)
    pieces = pieces[np.isfinite(pieces).all(axis=(1, 2))]
    with column_style():
        width, height = high - low
        figure = new_figure(COLUMN_INCHES, WIDTH_INCHES * float(height / width) + 0.75)
        axes = figure.subplots()
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        view.set_up(axes)
        say_frame(axes, IN_TRUTH)
        _, broken_truth = break_at_gaps(truth.timestamps, true_path)
        axes.plot(*broken_truth.T, color=TRUTH, linewidth=0.8, alpha=0.6, label="truth")
        colored = LineCollection(
            list(pieces[:, :, :2]), cmap="plasma", linewidth=1.8, capstyle="round", gid="error"
        )
        colored.set_array(pieces[:, :, 2].mean(axis=1))
        colored.set_clim(0.0, max(float(distance.max()), 1e-12))
        axes.add_collection(colored)
        figure.colorbar(
            colored,
            ax=axes,
            orientation="horizontal",
            label="distance of the estimate from the truth [m]",
            aspect=40,
            pad=0.02,
        )
        legend_above(figure, axes.get_lines())
    return figure
