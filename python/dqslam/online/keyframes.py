"""The keyframes of a session, their boxes, and which object each of them shows."""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._ids import ObjectId, ObjectRow
from dqslam.association.appearance import directions
from dqslam.association.labels import Labels
from dqslam.assumptions import OdometryNoise, SizePrior, SizePriors
from dqslam.online.inputs import CheckedBoxes
from dqslam.online.integrated_odometry import IntegratedOdometry

_NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Keyframe:
    """An image whose boxes take part in the estimate."""

    pose: int
    """Row of the session."""
    timestamp: float
    odometry: IntegratedOdometry
    """From the keyframe before."""
    boxes: CheckedBoxes


class KeyframeStore:
    """Keyframes in the order of time: the one owner of what their boxes show.

    Boxes are rows of all keyframes together, objects rows of the session. Arrays are replaced and
    never written to, so that a snapshot costs nothing.
    """

    def __init__(self, size_prior: SizePrior | SizePriors | None) -> None:
        """Begin without a keyframe."""
        self.keyframes: list[Keyframe] = []
        self.labels = Labels(_NONE, _NONE, 0)
        self.observation_rows = _NONE
        """Of each box, in the session, shape (m,)."""
        self.box_keyframe = _NONE
        """Keyframe of each box, shape (m,)."""
        self.tracker_ids = _NONE
        """Id that a tracker gave to each box, -1 for none, shape (m,)."""
        self.size_prior = size_prior
        """None until it has been learned from some objects."""
        self.odometry_noise = OdometryNoise()
        """Of one step, where that is estimated."""
        self.map_covariance: dict[ObjectRow, Floats] = {}
        """Of objects that were known before the session, (9, 9)."""
        self._class_ids: dict[str, int] = {}
        self.images: dict[int, tuple[Ints, Ints]] = {}
        """Of a step: its boxes that are identified, and their tracklets."""

    # ---- images

    def add_image(self, step: int, rows: Ints, tracklets: Ints, *, free_tracklet: int) -> None:
        """Remember the tracklets of some boxes of a step; numbers from the free one on are new."""
        self.images[step] = (rows, tracklets)
        self.labels.make_room(tracklets=free_tracklet)

    def add_keyframe(self, keyframe: Keyframe, observation_rows: Ints, tracklets: Ints) -> None:
        """Add the last image; its boxes wait."""
        number = np.full(len(tracklets), len(self.keyframes))
        self.box_keyframe = np.append(self.box_keyframe, number)
        self.observation_rows = np.append(self.observation_rows, observation_rows)
        self.tracker_ids = np.append(self.tracker_ids, keyframe.boxes.object_id)
        classes = self.class_ids(keyframe.boxes.class_name)
        self.labels.add_boxes(tracklets, classes, directions(keyframe.boxes.embedding))
        self.keyframes.append(keyframe)

    def class_ids(self, names: Sequence[str]) -> Ints:
        """Return the column of each name among the labels' votes, the same for the same."""
        ids = [self._class_ids.setdefault(name, len(self._class_ids)) for name in names]
        self.labels.make_room(classes=len(self._class_ids))
        return np.array(ids, dtype=np.int64)

    @property
    def class_names(self) -> dict[int, str]:
        """What the columns stand for."""
        return {number: name for name, number in self._class_ids.items()}

    # ---- objects

    def snapshot(self) -> Labels:
        """Return what boxes show now, to be compared with what they show later."""
        return copy.copy(self.labels)

    def keyframes_of(self, row: ObjectRow) -> Ints:
        """Return the keyframe of each box that shows an object, ascending."""
        return np.asarray(self.box_keyframe[self.labels.object_rows == row])

    def tracker_id_of(self, row: ObjectRow) -> ObjectId:
        """Return the id that a tracker gave to the first box of an object, -1 for none."""
        return ObjectId(int(self.tracker_ids[np.argmax(self.labels.object_rows == row)]))

    def votes(self, row: ObjectRow) -> Counter[str]:
        """Return how often an object was called what."""
        votes = self.labels.votes[row].tolist() if row < len(self.labels.votes) else []
        counts = [round(n) for n in votes]  # of one class each: they are whole
        return Counter({name: n for name, n in zip(self._class_ids, counts, strict=False) if n})

    def add_map_object(self, row: ObjectRow, class_name: str, covariance: Floats) -> None:
        """Add an object of a map, that is called its class once, and its covariance (9, 9)."""
        column = int(self.class_ids([class_name])[0])
        self.labels.make_room(objects=row + 1)
        self.labels.votes[row, column] += 1
        self.map_covariance[row] = covariance
