"""The detections of a drive, from the exact boxes of all objects."""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from dqslam._checks import Bools, Floats, Ints
from dqslam._core import Camera
from dqslam.recording import Detections
from dqslam.simulation.detector.border import cut_at_border, is_detected
from dqslam.simulation.detector.edges import disturb_edges
from dqslam.simulation.detector.false_boxes import FalseBoxes, draw_false_boxes
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
    drawn = _Drawn(pose, measured, said, object_row, truncated)
    return _joined(drawn, false, class_name)


class _Drawn(NamedTuple):
    """The boxes that show objects, one row each."""

    pose: Ints  # (m,)
    box: Floats  # (m, 4)
    said: Ints  # row of the object of the id, (m,)
    shown: Ints  # row of the object, (m,)
    truncated: Bools  # (m, 4)


def _joined(drawn: _Drawn, false: FalseBoxes, class_name: tuple[str, ...]) -> Boxes:
    """Put both kinds of boxes in the order of the poses.

    A false box has the class of the object that it pretends to be; if it is none, they take turns.
    """
    objects, names = len(class_name), tuple(dict.fromkeys(class_name))
    class_of_row = np.array([names.index(name) for name in class_name])
    own = -1 - false.said  # number of an id of its own
    pretended = np.where(false.said < 0, own % objects, false.said)
    order = np.argsort(np.concatenate([drawn.pose, false.pose]), kind="stable")
    uncut = np.zeros(false.box.shape, dtype=np.bool_)
    detections = Detections(
        pose=np.concatenate([drawn.pose, false.pose])[order],
        box=np.vstack([drawn.box, false.box])[order],
        score=np.ones(len(order)),
        class_id=class_of_row[np.concatenate([drawn.shown, pretended])[order]],
        object_id=np.concatenate([drawn.said, np.where(false.said < 0, objects + own, false.said)])[
            order
        ],
        class_names=dict(enumerate(names)),
        truncated=np.vstack([drawn.truncated, uncut])[order],
    )
    return Boxes(detections, np.concatenate([drawn.shown, np.full(len(own), -1)])[order])
