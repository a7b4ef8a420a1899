"""How many keyframes back the association looks, for objects that come into view again.

The covariance of where something was seen long ago, as seen from here, is that of the path
between: work as large as the loop. So much is looked at all the time; more is paid from what has
been saved, which keeps the work of a keyframe bounded in the mean.
"""

from __future__ import annotations

import numpy as np

from dqslam.association.consistency import close_pairs
from dqslam.association.gating import in_image
from dqslam.online.keyframes import Journal
from dqslam.online.local_map import Part

# Keyframes that are always looked at, and what each earns: as much again, now or later.
WINDOW = 40
EARNED = 1.0
# Boxes of an object that tell where it is: if the window has fewer, its last ones are looked at.
ENOUGH_BOXES = 8
# Objects are expected this far outside of the image, as a part of its size: the path may be off.
MARGIN = 0.5


class Reach:
    """Tells where the part of the path begins that the last keyframe is compared with."""

    def __init__(self) -> None:
        """Begin without savings."""
        self._saved = 0.0  # in windows
        self._asked: dict[tuple[int, int], int] = {}  # of a pair: boxes that were known

    def window(self, journal: Journal) -> int:
        """Return the first keyframe that is always looked at."""
        self._saved += EARNED
        return max(len(journal.keyframes) - 1 - WINDOW, 0)

    def for_strangers(self, part: Part, journal: Journal) -> int:
        """Return the first keyframe to look at for boxes that no object of the part explains."""
        scene = part.scene
        last = len(journal.keyframes) - 1
        rows = np.flatnonzero(scene.recording.detections.pose == last - part.begin)
        called = np.unique(scene.box_class[rows[scene.are_strangers(rows)]])
        if not called.size or part.begin == 0:
            return part.begin
        alive = np.flatnonzero(scene.box_counts > 0)
        alive = alive[np.isin(scene.votes[alive].argmax(axis=1), called)]
        near = in_image(
            scene.recording.camera,
            scene.recording.odometry.pose_model,
            scene.poses[-1],
            scene.ellipsoids[alive],
            margin=MARGIN,
        )
        return self._afford([_anchor(journal, number) for number in alive[near]], part, last)

    def for_duplicates(self, part: Part, journal: Journal) -> int:
        """Return the first keyframe to look at for objects that may be older ones."""
        near = set(np.unique(part.scene.box_object).tolist())
        anchors = []
        for pair in close_pairs(part.scene):
            boxes = min(len(journal.boxes_of(number)) for number in pair)
            one_is_near = len(near.intersection(pair)) == 1
            if one_is_near and boxes >= max(ENOUGH_BOXES, 2 * self._asked.get(pair, 0)):
                self._asked[pair] = boxes
                anchors.append(min(_anchor(journal, number) for number in pair))
        return self._afford(anchors, part, len(journal.keyframes) - 1)

    def _afford(self, anchors: list[int], part: Part, last: int) -> int:
        """Return the earliest of some keyframes that the savings reach, and pay for it."""
        reached = [one for one in anchors if (last - one) / WINDOW <= self._saved]
        begin = min([part.begin, *reached])
        if begin < part.begin:
            self._saved -= (last - begin) / WINDOW
        return begin


def _anchor(journal: Journal, number: int) -> int:
    """Return the keyframe from which on there are enough boxes of an object."""
    seen = journal.keyframes_of(number)
    return seen[-min(ENOUGH_BOXES, len(seen))] if seen else len(journal.keyframes) - 1
