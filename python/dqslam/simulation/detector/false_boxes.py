"""Boxes that show no object."""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from dqslam._checks import Floats, Ints
from dqslam._core import Camera
from dqslam.simulation.scenario import DetectorSettings


class FalseBoxes(NamedTuple):
    """False boxes, one row each."""

    pose: Ints  # (f,)
    box: Floats  # (f, 4), px
    said: Ints  # row of an object, or -1 - k for the k-th id of its own; (f,)


def draw_false_boxes(
    pose: Ints,
    said: Ints,
    box: Floats,
    poses: int,
    camera: Camera,
    settings: DetectorSettings,
    random: Generator,
) -> FalseBoxes:
    """Draw boxes of the sizes of others, uniformly over all images and places inside of them.

    Parameters
    ----------
    pose, said, box
        Of the boxes that show objects: pose and row of the object of their id, (m,), and edges,
        (m, 4).
    poses
        Number of poses.
    """
    count = round(len(pose) * settings.false_boxes / (1.0 - settings.false_boxes))
    size = (box[:, 2:] - box[:, :2])[random.integers(max(len(box), 1), size=count)]
    image = np.array([camera.width, camera.height], dtype=np.float64)
    size = np.minimum(size, image)
    low = random.random((count, 2)) * (image - size) - 0.5
    if settings.false_box_ids == "known":
        where, ids = _free_places(pose, said, poses, count, random)
    else:
        where, ids = random.integers(poses, size=count), -1 - np.arange(count)
    return FalseBoxes(where, np.hstack([low, low + size]), ids)


def _free_places(
    pose: Ints, said: Ints, poses: int, count: int, random: Generator
) -> tuple[Ints, Ints]:
    """Draw pairs of a pose and an object without a box there: a tracker gives an id out once."""
    known, column = np.unique(said, return_inverse=True)
    is_free = np.ones((poses, len(known)), dtype=np.bool_)
    is_free[pose, column] = False
    free = np.argwhere(is_free)
    if len(free) < count:
        raise ValueError(f"detector.false_boxes: no place for {count} boxes of known objects")
    chosen = free[random.choice(len(free), size=count, replace=False)] if count else free[:0]
    return chosen[:, 0], known[chosen[:, 1]]
