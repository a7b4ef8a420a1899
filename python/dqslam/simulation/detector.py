"""A simulated detector: the objects that get a box, how it is cut, and the id that it has."""

import numpy as np
from numpy.random import Generator

from dqslam._checks import Bools, Floats, Ints
from dqslam._core import Camera
from dqslam.simulation.scenario import DetectorSettings


def cut_at_border(box: Floats, camera: Camera) -> tuple[Floats, Bools]:
    """Cut boxes (..., 4) at the border of the image, and flag the edges that moved."""
    first = np.full(4, -0.5)
    last = np.array([camera.width, camera.height] * 2) - 0.5
    outside = (box < first) | (box > last)
    return np.clip(box, first, last), outside


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


def associate(
    pose: Ints, object_row: Ints, center: Floats, settings: DetectorSettings, random: Generator
) -> Ints:
    """Return the object row of each detection (m,), some of them wrong.

    Every pair of pose and object has its own random numbers, whether it was detected or not. A
    wrong row is that of another detected object; if there is no other, all are right.

    Parameters
    ----------
    pose, object_row
        Pose and object of each detection, shape (m,).
    center
        True centers of all objects, meters, shape (o, 3).
    """
    size = (int(pose.max(initial=0)) + 1, len(center))
    is_wrong = random.random(size)[pose, object_row] < settings.wrong_associations
    which = random.random(size)[pose, object_row]
    said = object_row.copy()
    detected = np.unique(object_row)
    if len(detected) < 2:
        return said
    for row in np.flatnonzero(is_wrong):
        others = detected[detected != object_row[row]]
        if settings.wrong_association_kind == "structured":
            distance = np.linalg.norm(center[others] - center[object_row[row]], axis=1)
            said[row] = others[distance.argmin()]
        else:
            said[row] = others[int(which[row] * len(others))]
    return said
