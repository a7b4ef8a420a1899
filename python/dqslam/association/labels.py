"""Labels: which object each box shows, and the tracklets and objects that this makes."""

from __future__ import annotations

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam._ids import ObjectRow
from dqslam.association.appearance import CLEARLY_DIFFERENT, Appearance, directions
from dqslam.association.gating import CONFUSED
from dqslam.recording import Detections


class Labels:
    """Which object each of some boxes shows.

    Objects keep their row for good; one that is given up has no boxes any more.
    """

    def __init__(
        self,
        tracklets: Ints,
        box_class: Ints,
        class_count: int,
        *,
        shares: Floats | None = None,
        looks: Floats | None = None,
    ) -> None:
        """Let boxes wait, of tracklets from 0 on and classes that are columns of ``votes``.

        Parameters
        ----------
        box_class
            Of each box, shape (m,), or its k possible classes, the likeliest first, (m, k).
        shares
            Probability of each of these, shape (m, k); a box has one class by default.
        looks
            What each box looks like, unit vectors (m, e); by default nothing is known of it.
        """
        count = len(tracklets)
        self.tracklets = tracklets
        """Of each box, shape (m,)."""
        self.classes = box_class.reshape(count, -1) if count else box_class.reshape(0, 1)
        """Columns of ``votes`` of each box, the likeliest first, shape (m, k)."""
        self.shares = np.ones(self.classes.shape) if shares is None else shares
        """Probability of each of these classes, shape (m, k)."""
        self.looks = np.zeros((count, 0)) if looks is None else looks
        """What each box looks like, unit vectors (m, e)."""
        self.appearance: Appearance | None = None
        """What similar looks say; None where they say nothing."""
        self.object_rows = np.full(len(tracklets), -1)
        """Object that each box shows, -1 while it waits, shape (m,)."""
        self.object_of_tracklet = np.full(int(tracklets.max(initial=-1)) + 1, -1)
        """Object that the boxes of each tracklet should show, -1 for none, shape (t,)."""
        self.votes = np.zeros((0, class_count))
        """How often each object was called each class, shape (o, c)."""
        self.class_evidence = np.zeros((0, class_count))
        """Sum of ln of the probabilities of each class, where boxes have several, shape (o, c)."""
        self.look_sums = np.zeros((0, self.looks.shape[1]))
        """Sum of what the boxes of each object look like, shape (o, e)."""
        self.joined_into = np.zeros(0, dtype=np.int64)
        """Object that each was joined into, itself by default, shape (o,)."""
        self.dropped: dict[ObjectRow, str] = {}
        """Objects that take no part in the estimate, and why."""

    def since(self, first: int) -> Labels:
        """Return the labels of the boxes from a row on, to be changed without changing these."""
        part = Labels(
            self.tracklets[first:].copy(),
            self.classes[first:],
            0,
            shares=self.shares[first:],
            looks=self.looks[first:],
        )
        part.object_rows = self.object_rows[first:].copy()
        part.take_objects(self)
        return part

    def take_objects(self, other: Labels) -> None:
        """Know the objects that other labels know, and which tracklets show them."""
        self.object_of_tracklet = other.object_of_tracklet.copy()
        self.votes, self.look_sums = other.votes.copy(), other.look_sums.copy()
        self.class_evidence = other.class_evidence.copy()
        self.joined_into = np.arange(len(self.votes))
        self.dropped, self.appearance = dict(other.dropped), other.appearance

    @classmethod
    def of(cls, detections: Detections, tracklets: Ints) -> Labels:
        """Let the boxes of a recording wait, of tracklets (m,)."""
        names = np.array(sorted(detections.class_names))
        ids, shares = class_shares(detections)
        return cls(
            tracklets.copy(),
            np.searchsorted(names, ids),
            len(names),
            shares=shares,
            looks=directions(detections.embedding),
        )

    def make_room(self, *, tracklets: int = 0, objects: int = 0, classes: int = 0) -> None:
        """Have at least so many tracklets, objects and classes, in new arrays."""
        new = tracklets - len(self.object_of_tracklet)
        if new > 0:
            self.object_of_tracklet = np.append(self.object_of_tracklet, np.full(new, -1))
        rows, columns = self.votes.shape
        if objects > rows or classes > columns:
            objects, classes = max(objects, rows), max(classes, columns)
            more = ((0, objects - rows), (0, classes - columns))
            self.votes = np.pad(self.votes, more)
            self.class_evidence = np.pad(self.class_evidence, more)
            self.look_sums = np.pad(self.look_sums, (more[0], (0, 0)))
            self.joined_into = np.append(self.joined_into, np.arange(rows, objects))

    def add_boxes(self, tracklets: Ints, box_class: Ints, looks: Floats | None = None) -> None:
        """Let more boxes wait, of one class each, (b,), in new arrays."""
        new = np.zeros((len(tracklets), 0)) if looks is None else looks
        if not len(self.tracklets):  # the first boxes tell how long the vectors are
            self.looks = np.zeros((0, new.shape[1]))
            self.look_sums = np.zeros((len(self.votes), new.shape[1]))
        self.tracklets = np.append(self.tracklets, tracklets)
        self.classes = np.concatenate([self.classes, box_class[:, None]])
        self.shares = np.concatenate([self.shares, np.ones((len(box_class), 1))])
        self.looks = np.concatenate([self.looks, new])
        self.object_rows = np.append(self.object_rows, np.full(len(tracklets), -1))

    # ---- what is known

    @property
    def box_class(self) -> Ints:
        """Column of ``votes`` of the likeliest class of each box, shape (m,)."""
        return self.classes[:, 0]

    @property
    def box_counts(self) -> Ints:
        """Boxes of each object, shape (o,)."""
        return np.asarray(np.rint(self.votes.sum(axis=1)), dtype=np.int64)

    @property
    def shown_objects(self) -> Ints:
        """Objects that some of these boxes show, ascending."""
        return np.unique(self.object_rows[self.object_rows >= 0])

    @property
    def takes_part(self) -> Bools:
        """Whether each object takes part in the estimate, shape (o + 1,); row -1 never does."""
        flags = np.ones(len(self.votes) + 1, dtype=np.bool_)
        flags[[*self.dropped, -1]] = False
        return flags

    def are_strangers(self, rows: Ints) -> Bools:
        """Return which boxes (b,) wait, of tracklets without an object."""
        known = self.object_of_tracklet[self.tracklets[rows]] >= 0
        return (self.object_rows[rows] < 0) & ~known

    def class_probability(self, rows: Ints, object_rows: Ints) -> Floats:
        """Return the probability of the classes of boxes (b,) for objects (p,), shape (b, p).

        Of one class each, it is how often the object was called that. Of several, it is how likely
        the box and the object are of one class, as all boxes of the object say together.
        """
        if self.classes.shape[1] > 1:
            evidence = self.class_evidence[object_rows]
            called = np.exp(evidence - evidence.max(axis=1, keepdims=True, initial=0.0))
        else:
            called = self.votes[object_rows]
        called = np.maximum(called / np.maximum(called.sum(axis=1, keepdims=True), 1), CONFUSED)
        classes, shares = self.classes[rows], self.shares[rows]
        parts = [shares[:, [k]] * called[:, classes[:, k]].T for k in range(self.classes.shape[1])]
        return np.asarray(sum(parts))

    def look_odds(self, rows: Ints, object_rows: Ints) -> Floats:
        """Return the log odds that boxes (b,) look as objects (p,) do, shape (b, p)."""
        if self.appearance is None:
            return np.zeros((len(rows), len(object_rows)))
        return self.appearance.log_odds(self.looks[rows] @ self._mean_looks(object_rows).T)

    def look_different(self, a: ObjectRow, b: ObjectRow) -> bool:
        """Return whether two objects clearly do not look the same."""
        if self.appearance is None:
            return False
        first, second = self._mean_looks(np.array([a, b]))
        return bool(self.appearance.log_odds(first @ second) < CLEARLY_DIFFERENT)

    def _mean_looks(self, object_rows: Ints) -> Floats:
        """Return the mean vectors of the boxes of objects (p,), shape (p, e)."""
        counts = np.maximum(self.box_counts[object_rows], 1)
        return np.asarray(self.look_sums[object_rows] / counts[:, None])

    # ---- changes

    def assign(self, rows: Ints, object_rows: Ints) -> None:
        """Give waiting boxes to objects (b,), or to none where the row is -1."""
        rows, object_rows = rows[object_rows >= 0], object_rows[object_rows >= 0]
        self.object_rows[rows] = object_rows
        self._count(rows, 1.0)

    def release(self, rows: Ints) -> None:
        """Take boxes (b,) from their objects."""
        rows = rows[self.object_rows[rows] >= 0]
        self._count(rows, -1.0)
        self.object_rows[rows] = -1

    def release_all(self) -> None:
        """Take all boxes from their objects, and forget which tracklet shows which."""
        self.object_rows[:] = -1
        self.object_of_tracklet[:] = -1
        for sums in (self.votes, self.class_evidence, self.look_sums):
            sums[:] = 0

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
        for sums in (self.votes, self.class_evidence, self.look_sums):
            sums[kept] += sums[given_up]
            sums[given_up] = 0

    def give_up(self, object_rows: Ints) -> None:
        """Let the boxes of some objects (o,) wait for others."""
        for rows in (self.object_rows, self.object_of_tracklet):
            rows[np.isin(rows, object_rows)] = -1
        for sums in (self.votes, self.class_evidence, self.look_sums):
            sums[object_rows] = 0

    def _count(self, rows: Ints, sign: float) -> None:
        """Add boxes (b,) to the objects that they show, or take them off with a sign of -1."""
        shown = self.object_rows[rows]
        place, shares = (shown[:, None], self.classes[rows]), self.shares[rows]
        np.add.at(self.votes, place, sign * shares)
        if shares.shape[1] > 1:
            evidence = np.log(np.maximum(shares, CONFUSED) / CONFUSED)
            np.add.at(self.class_evidence, place, sign * evidence)
        if self.looks.shape[1]:
            np.add.at(self.look_sums, shown, sign * self.looks[rows])


def class_shares(detections: Detections) -> tuple[Ints, Floats]:
    """Return the possible classes of boxes, the likeliest first, and their probabilities, (m, k).

    Probabilities are in proportion to the confidences of the detector. Where there is no other
    class, the number of the first one is repeated with a probability of 0.
    """
    first = detections.class_id[:, None]
    others = np.where(detections.other_class_id >= 0, detections.other_class_id, first)
    others_score = np.where(detections.other_class_id >= 0, detections.other_score, 0.0)
    if not others.shape[1]:
        return first, np.ones(first.shape)
    score = np.hstack([detections.score[:, None], others_score])
    score[score.sum(axis=1) <= 0, 0] = 1.0
    return np.hstack([first, others]), score / score.sum(axis=1, keepdims=True)
