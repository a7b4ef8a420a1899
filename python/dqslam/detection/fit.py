"""How an image is fitted into the input of a network, and boxes back into the image.

Coordinates count from the corner of the image. A resized image covers the same rectangle as the
original one, so the two sides scale such coordinates by ratios of whole numbers of pixels. These
ratios are used here, not the one real number that both sides were rounded from: boxes are undone
exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from dqslam._checks import Floats

Fit = Literal["letterbox", "corner", "stretch"]
BAR = 114  #: gray value of the bars, with which these networks are trained


@dataclass(frozen=True)
class Placement:
    """Where an image is in the input of a network.

    ``image`` (width, height) px of the image, ``resized`` its size in the input, and ``offset`` the
    left and upper bar, px of the input.
    """

    image: tuple[int, int]
    resized: tuple[int, int]
    offset: tuple[int, int]

    def to_image(self, corner: Floats) -> Floats:
        """Carry corners (m, 4) px of the input to the image, and cut them at its border."""
        size = np.array(self.image * 2, dtype=float)
        scale = size / np.array(self.resized * 2)
        moved = (corner - np.array(self.offset * 2)) * scale
        cut: Floats = np.clip(moved, 0.0, size)
        return cut


def place(image: tuple[int, int], model: tuple[int, int], fit: Fit) -> Placement:
    """Place an image into an input; sizes are (width, height) px.

    ``letterbox`` keeps the aspect and centers the image, ``corner`` keeps it too and has the bars
    right and below, and ``stretch`` fills the input.
    """
    if fit == "stretch":
        return Placement(image, model, (0, 0))
    ratio = min(model[0] / image[0], model[1] / image[1])
    # YOLOX cuts the fraction of a pixel off, YOLOv5 and its kin round it.
    whole = int if fit == "corner" else round
    resized = (max(1, whole(image[0] * ratio)), max(1, whole(image[1] * ratio)))
    if fit == "corner":
        return Placement(image, resized, (0, 0))
    left, top = ((model[side] - resized[side]) / 2 for side in (0, 1))
    return Placement(image, resized, (round(left - 0.1), round(top - 0.1)))


def fitted(image: Any, model: tuple[int, int], where: Placement) -> Any:
    """Return the input (height, width, 3) uint8 of an image (h, w, 3) uint8."""
    import cv2

    if where.resized != where.image:
        image = cv2.resize(image, where.resized, interpolation=cv2.INTER_LINEAR)
    canvas = np.full((model[1], model[0], 3), BAR, dtype=np.uint8)
    (left, top), (width, height) = where.offset, where.resized
    canvas[top : top + height, left : left + width] = image
    return canvas
