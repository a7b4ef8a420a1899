"""The view of one pose: its boxes, and the objects of the map."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.evaluation import BoxFits
from dqslam.io import Results
from dqslam.lens import distort_boxes, outline_tilts
from dqslam.plot.style import GRAY

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_boxes(
    axes: "Axes",
    results: Results,
    fits: BoxFits,
    pose: int,
    colors: Sequence[str],
    *,
    lens: bool,
    linewidth: float,
    unmapped: str = GRAY,
) -> Ints:
    """Draw the detected boxes of a pose, and return the rows of their objects.

    With ``lens``, pixels are those of the image as recorded; otherwise they are undistorted.
    ``colors`` are those of the objects of the map, and ``unmapped`` that of boxes without one.
    Held-out boxes are dotted.
    """
    rows = np.flatnonzero(fits.boxes.pose == pose)
    boxes = fits.boxes.box[rows]
    if lens:
        boxes = distort_boxes(results.camera, boxes, _tilts(results, fits.object_row[rows], pose))
    for row, box in zip(rows, boxes, strict=True):
        seen = fits.object_row[row]
        color = unmapped if seen < 0 else colors[seen]
        held_out = bool(fits.boxes.held_out[row])
        axes.plot(
            *rectangle(box),
            color=color,
            linewidth=linewidth,
            linestyle=":" if held_out else "-",
            gid="detected" if seen >= 0 else "not mapped",
        )
    return np.unique(fits.object_row[rows][fits.object_row[rows] >= 0])


def _tilts(results: Results, object_row: Ints, pose: int) -> Floats:
    """Return the tilts of the outlines that boxes bound, (m,); NaN without an object in front."""
    known = object_row >= 0
    tilts = np.full(len(object_row), np.nan)
    objects = results.objects.ellipsoids[object_row[known]]
    here = np.tile(results.poses[pose], (len(objects), 1))
    tilts[known] = outline_tilts(_core.PoseModel.SE3, results.camera, here, objects)
    return tilts


def rectangle(box: Floats) -> Floats:
    """Return the corners (2, 5) of a box, with the first repeated at the end."""
    u_min, v_min, u_max, v_max = box
    return np.array([[u_min, u_max, u_max, u_min, u_min], [v_min, v_min, v_max, v_max, v_min]])
