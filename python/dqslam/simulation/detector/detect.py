"""The detections of a drive, from the exact boxes of all objects."""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from dqslam._checks import Bools, Floats, Ints
from dqslam._core import Camera
from dqslam.recording import Detections
from dqslam.simulation.detector.border import cut_at_border, is_detected
from dqslam.simulation.detector.edges import disturb_edges
from dqslam.simulation.detector.false_boxes import draw_false_boxes
from dqslam.simulation.detector.ids import associate, switch_in_bursts
from dqslam.simulation.scenario import DetectorSettings


class Streams(NamedTuple):
    """Random numbers, a stream for each part of a detector."""

    edges: Generator
    ids: Generator
    tails: Generator
    misses: Generator
    bursts: Generator
    false_boxes: Generator


class Boxes(NamedTuple):
    """What a detector drew, and the rows of the objects that it drew."""

    detections: Detections
    object_row: Ints
    """Row of the object that each box shows, -1 for none; shape (m,)."""


def detect(
    box: Floats,
    is_seen: Bools,
    center: Floats,
    class_name: tuple[str, ...],
    camera: Camera,
    settings: DetectorSettings,
    streams: Streams,
) -> Boxes:
    """Draw boxes, with errors, and give them ids, which are rows of objects.

    Every pair of pose and object has its own numbers for edges and misses.

    Parameters
    ----------
    box, is_seen
        Boxes of the objects, px, shape (n, o, 4), and which of them may be detected, (n, o).
    center
        True centers of all objects, meters, shape (o, 3).
    class_name
        Class of each object.
    """
    is_missed = streams.misses.random(is_seen.shape) < settings.missing_boxes
    seen = np.argwhere(is_seen & ~is_missed & is_detected(box, camera, settings))
    measured = disturb_edges(box, settings, streams.edges, streams.tails)[seen[:, 0], seen[:, 1]]
    truncated = np.zeros(measured.shape, dtype=np.bool_)
    if settings.truncation == "clip":
        measured, truncated = cut_at_border(measured, camera)
    # A thin box may be turned inside out by its errors: no detector draws that.
    is_box = (measured[:, :2] < measured[:, 2:]).all(axis=1)
    seen, measured, truncated = seen[is_box], measured[is_box], truncated[is_box]
    pose, object_row = seen[:, 0], seen[:, 1]
    said = associate(pose, object_row, center, settings, streams.ids)
    said = switch_in_bursts(said, object_row, settings, streams.bursts)
    false = draw_false_boxes(pose, said, measured, len(box), camera, settings, streams.false_boxes)
    names = tuple(dict.fromkeys(class_name))
    class_of_row = np.array([names.index(name) for name in class_name])
    order = np.argsort(np.concatenate([pose, false.pose]), kind="stable")
    own = len(class_name) - 1 - false.said  # after the ids of the objects
    object_id = np.concatenate([said, np.where(false.said < 0, own, false.said)])
    shown = np.concatenate([object_row, np.full(len(false.pose), -1)])
    of_class = np.concatenate([class_of_row[object_row], _classes_of(false.said, class_of_row)])
    detections = Detections(
        pose=np.concatenate([pose, false.pose])[order],
        box=np.vstack([measured, false.box])[order],
        score=np.ones(len(order)),
        class_id=of_class[order],
        object_id=object_id[order],
        class_names=dict(enumerate(names)),
        truncated=np.vstack([truncated, np.zeros(false.box.shape, dtype=np.bool_)])[order],
    )
    return Boxes(detections, shown[order])


def _classes_of(said: Ints, class_of_row: Ints) -> Ints:
    """Return the class of the object that a false box pretends to be; in turn if it is none."""
    return np.asarray(class_of_row[np.where(said < 0, (-1 - said) % len(class_of_row), said)])
