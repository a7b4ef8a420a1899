"""The view of one pose: its boxes, and the objects of the map."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.evaluation import BoxFits
from dqslam.io import Results
from dqslam.metrics import boxes_through_lens, project_outlines, through_lens
from dqslam.plot.style import GRAY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Style = Mapping[str, Any]


def draw_boxes(
    axes: "Axes",
    results: Results,
    fits: BoxFits,
    pose: int,
    styles: Mapping[str, Style],
    *,
    lens: bool,
    linewidth: float,
    unmapped: str = GRAY,
) -> Ints:
    """Draw the detected boxes of a pose, and return the rows of their objects.

    With ``lens`` the pixels are those of the image as recorded. ``unmapped`` is the color of boxes
    without an object in the map. Boxes that were held out are dotted.
    """
    rows = np.flatnonzero(fits.boxes.pose == pose)
    boxes = fits.boxes.box[rows]
    if lens:
        boxes = boxes_through_lens(results.camera, boxes)
    for row, box in zip(rows, boxes, strict=True):
        seen = fits.object_row[row]
        color = unmapped if seen < 0 else styles[results.objects.class_name[seen]]["color"]
        held_out = bool(fits.boxes.held_out[row])
        axes.plot(
            *rectangle(box),
            color=color,
            linewidth=linewidth,
            linestyle=":" if held_out else "-",
            gid="detected" if seen >= 0 else "not mapped",
        )
    return np.unique(fits.object_row[rows][fits.object_row[rows] >= 0])


def visible_outlines(results: Results, pose: int, *, lens: bool) -> tuple[Ints, Floats]:
    """Return the rows of the objects in the image of a pose, far ones first, and their outlines.

    The shapes are (v,) and (v, n, 2). Occlusion is not considered.
    """
    camera, objects = results.camera, results.objects
    here = np.repeat(results.world_from_camera[[pose]], len(objects), axis=0)
    outlines = project_outlines(camera, here, objects.ellipsoids)
    if lens:
        outlines = through_lens(camera, outlines)
    shown = np.flatnonzero(_in_image(outlines, np.array([camera.width, camera.height])))
    distance = np.linalg.norm(objects.center[shown] - here[shown, :3], axis=1)
    order = np.argsort(-distance, kind="stable")
    return shown[order], outlines[shown[order]]


def rectangle(box: Floats) -> Floats:
    """Return the corners (2, 5) of a box, with the first repeated at the end."""
    u_min, v_min, u_max, v_max = box
    return np.array([[u_min, u_max, u_max, u_min, u_min], [v_min, v_min, v_max, v_max, v_min]])


def _in_image(outlines: Floats, size: Floats) -> Bools:
    """Return whether each outline (m, n, 2) has any part in the image."""
    if not len(outlines):
        return np.zeros(0, dtype=np.bool_)
    known = np.all(np.isfinite(outlines), axis=2)
    low = np.where(known[:, :, None], outlines, np.inf).min(axis=1)
    high = np.where(known[..., None], outlines, -np.inf).max(axis=1)
    return np.asarray((high >= -0.5).all(axis=1) & (low <= size - 0.5).all(axis=1))
