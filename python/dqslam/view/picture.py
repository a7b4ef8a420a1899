"""The image plane of one pose as SVG, with its boxes and the outlines of the objects in it."""

from __future__ import annotations

from html import escape

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._repr import printable
from dqslam.metrics import visible_outlines
from dqslam.view.scene import Scene

_DASHES = {"fits": "", "misfit": "6 4", "held out": "1.5 3", "left out": ""}
_POINTS = 64
_GRAY = "#999999"


def outlines_in_image(scene: Scene, frame: int) -> tuple[Ints, Floats]:
    """Return the rows of the objects that are in an image, (k,), and their outlines, (k, p, 2).

    These are in front of the camera and overlap the image, ordered from far to near.
    """
    return visible_outlines(scene.camera, scene.estimate[frame], scene.solids, points=_POINTS)


def draw_image(scene: Scene, frame: int, selected: int | None = None) -> str:
    """Return the SVG of an image; ``selected`` is the row of an object to highlight."""
    width, height = scene.camera.width, scene.camera.height
    line = width / 320.0  # about one pixel of the screen
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-0.5 -0.5 {width} {height}" '
        f'style="width:100%;background:#fff;display:block" font-family="sans-serif" '
        f'font-size="{10.0 * line:.1f}">'
    ]
    boxes = scene.boxes
    shown = np.flatnonzero(boxes.pose == frame)
    seen = set(boxes.object[shown].tolist())
    for row, outline in zip(*outlines_in_image(scene, frame), strict=True):
        points = " ".join(f"{u:.1f},{v:.1f}" for u, v in outline)
        is_seen, color = int(row) in seen, scene.objects[row].color
        fill = 0.4 if row == selected else 0.15 if is_seen else 0.0
        parts.append(
            f'<polygon class="outline" points="{points}" stroke="{color}" fill="{color}" '
            f'fill-opacity="{fill}" stroke-opacity="{1.0 if is_seen else 0.35}" '
            f'stroke-width="{1.4 * line:.2f}"/>'
        )
    for row in shown:
        parts.append(_box(scene, int(row), selected, line))
    return "".join([*parts, "</svg>"])


def _box(scene: Scene, row: int, selected: int | None, line: float) -> str:
    boxes = scene.boxes
    left, top, right, bottom = boxes.box[row]
    of = int(boxes.object[row])
    color = scene.objects[of].color if of >= 0 else _GRAY
    thickness = 0.8 if of < 0 else 3.0 if of == selected else 1.8
    dashes = " ".join(f"{line * float(dash):.1f}" for dash in _DASHES[boxes.state[row]].split())
    return (
        f'<rect class="box" x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
        f'height="{bottom - top:.1f}" fill="none" stroke="{color}" '
        f'stroke-width="{thickness * line:.2f}" stroke-dasharray="{dashes}"/>'
        f'<text x="{left:.1f}" y="{max(top - 3.0 * line, 10.0 * line):.1f}">'
        f"{escape(printable(boxes.class_name[row]))}</text>"
    )
