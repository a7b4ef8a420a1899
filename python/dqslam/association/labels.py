"""Labels: which object each box shows, and the tracklets and objects that this makes."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.association.gating import CONFUSED
from dqslam.recording import Detections


class Labels:
    """Which object each of some boxes shows.

    Objects keep their row for good; one that is given up has no boxes any more.
    """

    def __init__(self, tracklets: Ints, box_class: Ints, class_count: int) -> None:
        """Let boxes wait, of tracklets from 0 on and classes that are columns of ``votes``."""
        self.tracklets = tracklets
        """Of each box, shape (m,)."""
        self.box_class = box_class
        """Column of ``votes`` of each box, shape (m,)."""
        self.object_rows = np.full(len(tracklets), -1)
        """Object that each box shows, -1 while it waits, shape (m,)."""
        self.object_of_tracklet = np.full(int(tracklets.max(initial=-1)) + 1, -1)
        """Object that the boxes of each tracklet should show, -1 for none, shape (t,)."""
        self.votes = np.zeros((0, class_count), dtype=np.int64)
        """How often each object was called each class, shape (o, c)."""
        self.joined_into = np.zeros(0, dtype=np.int64)
        """Object that each was joined into, itself by default, shape (o,)."""
        self.left_out: dict[ObjectRow, str] = {}
        """Objects that take no part in the estimate, and why."""

    def since(self, first: int) -> Labels:
        """Return the labels of the boxes from a row on, to be changed without changing these."""
        part = Labels(self.tracklets[first:].copy(), self.box_class[first:], 0)
        part.object_rows = self.object_rows[first:].copy()
        part.object_of_tracklet = self.object_of_tracklet.copy()
        part.votes = self.votes.copy()
        part.joined_into = np.arange(len(self.votes))
        part.left_out = dict(self.left_out)
        return part

    @classmethod
    def of(cls, detections: Detections, tracklets: Ints) -> Labels:
        """Let the boxes of a recording wait, of tracklets (m,)."""
        classes = np.array(sorted(detections.class_names))
        return cls(tracklets.copy(), np.searchsorted(classes, detections.class_id), len(classes))

    def make_room(self, *, tracklets: int = 0, objects: int = 0, classes: int = 0) -> None:
        """Have at least so many tracklets, objects and classes, in new arrays."""
        new = tracklets - len(self.object_of_tracklet)
        if new > 0:
            self.object_of_tracklet = np.append(self.object_of_tracklet, np.full(new, -1))
        rows, columns = self.votes.shape
        if objects > rows or classes > columns:
            votes = np.zeros((max(objects, rows), max(classes, columns)), dtype=np.int64)
            votes[:rows, :columns] = self.votes
            self.votes = votes
            self.joined_into = np.append(self.joined_into, np.arange(rows, len(votes)))

    def add_boxes(self, tracklets: Ints, box_class: Ints) -> None:
        """Let more boxes wait, in new arrays."""
        self.tracklets = np.append(self.tracklets, tracklets)
        self.box_class = np.append(self.box_class, box_class)
        self.object_rows = np.append(self.object_rows, np.full(len(tracklets), -1))

    # ---- what is known

    @property
    def box_counts(self) -> Ints:
        """Boxes of each object, shape (o,)."""
        return np.asarray(self.votes.sum(axis=1))

    @property
    def shown_objects(self) -> Ints:
        """Objects that some of these boxes show, ascending."""
        return np.unique(self.object_rows[self.object_rows >= 0])

    @property
    def takes_part(self) -> Bools:
        """Whether each object takes part in the estimate, shape (o + 1,); row -1 never does."""
        flags = np.ones(len(self.votes) + 1, dtype=np.bool_)
        flags[[*self.left_out, -1]] = False
        return flags

    def are_strangers(self, rows: Ints) -> Bools:
        """Return which boxes (b,) wait, of tracklets without an object."""
        known = self.object_of_tracklet[self.tracklets[rows]] >= 0
        return (self.object_rows[rows] < 0) & ~known

    def class_probability(self, rows: Ints, object_rows: Ints) -> Floats:
        """Return the probability of the class of boxes (b,) for objects (p,), shape (b, p)."""
        votes = self.votes[object_rows]
        share = votes / np.maximum(votes.sum(axis=1, keepdims=True), 1)
        return np.asarray(np.maximum(share, CONFUSED)[:, self.box_class[rows]].T)

    # ---- changes

    def assign(self, rows: Ints, object_rows: Ints) -> None:
        """Give waiting boxes to objects (b,), or to none where the row is -1."""
        rows, object_rows = rows[object_rows >= 0], object_rows[object_rows >= 0]
        self.object_rows[rows] = object_rows
        np.add.at(self.votes, (object_rows, self.box_class[rows]), 1)

    def release(self, rows: Ints) -> None:
        """Take boxes (b,) from their objects."""
        rows = rows[self.object_rows[rows] >= 0]
        np.add.at(self.votes, (self.object_rows[rows], self.box_class[rows]), -1)
        self.object_rows[rows] = -1

    def release_all(self) -> None:
        """Take all boxes from their objects, and forget which tracklet shows which."""
        self.object_rows[:] = -1
        self.object_of_tracklet[:] = -1
        self.votes[:] = 0

    def cut_tracklet(self, rows: Ints) -> None:
        """Make boxes (b,) a tracklet of their own."""
        self.tracklets[rows] = len(self.object_of_tracklet)
        self.make_room(tracklets=len(self.object_of_tracklet) + 1)

    def add_object(self, rows: Ints) -> None:
        """Add an object and its first boxes, whose tracklets become its own."""
        added = len(self.votes)
        self.make_room(objects=added + 1)
        self.assign(rows, np.full(len(rows), added))
        self.object_of_tracklet[self.tracklets[rows]] = added

    def join_objects(self, kept: ObjectRow, given_up: ObjectRow) -> None:
        """Make two objects one."""
        for rows in (self.object_rows, self.object_of_tracklet, self.joined_into):
            rows[rows == given_up] = kept
        self.votes[kept] += self.votes[given_up]
        self.votes[given_up] = 0

    def give_up(self, object_rows: Ints) -> None:
        """Let the boxes of some objects (o,) wait for others."""
        for rows in (self.object_rows, self.object_of_tracklet):
            rows[np.isin(rows, object_rows)] = -1
        self.votes[object_rows] = 0
