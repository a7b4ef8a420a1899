"""Boxes at the border of the image, and which of them a detector finds."""

import numpy as np

from dqslam._checks import Bools, Floats
from dqslam._core import Camera
from dqslam.simulation.scenario import DetectorSettings


def cut_at_border(box: Floats, camera: Camera) -> tuple[Floats, Bools]:
    """Cut boxes (..., 4) at the border of the image, and flag the edges that moved."""
    first = np.full(4, -0.5)
    last = np.array([camera.width, camera.height] * 2) - 0.5
    outside = (box < first) | (box > last)
    return np.clip(box, first, last), outside


def is_in_image(box: Floats, camera: Camera) -> Bools:
    """Return which boxes (..., 4) meet the image; NaN does not."""
    last = np.array([camera.width, camera.height]) - 0.5
    return np.asarray((box[..., 2:] > -0.5).all(axis=-1) & (box[..., :2] < last).all(axis=-1))


def is_detected(box: Floats, camera: Camera, settings: DetectorSettings) -> Bools:
    """Return which exact boxes (..., 4) are detected; NaN is not.

    The longer side of the part inside the image must exceed `min_side_px`. With "discard" the whole
    box must be inside; with "clip" at least `min_visible_fraction` of its area must be.
    """
    inside, is_cut = cut_at_border(box, camera)
    size = inside[..., 2:] - inside[..., :2]
    large = size.max(axis=-1) > settings.min_side_px
    if settings.truncation == "discard":
        return np.asarray(large & ~is_cut.any(axis=-1))
    whole = box[..., 2:] - box[..., :2]
    enough = size.prod(axis=-1) >= settings.min_visible_fraction * whole.prod(axis=-1)
    return np.asarray(large & enough)
