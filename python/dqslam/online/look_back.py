"""How many keyframes back the association looks, for objects that come into view again.

The covariance of where something was seen long ago, as seen from here, is that of the path
between: work as large as the loop. So much is looked at all the time; more is paid from what has
been saved, which keeps the work of a keyframe bounded in the mean. A few looks at the whole
path are the most that is saved, so that long looks do not follow one after the other for long.
"""

from __future__ import annotations

import numpy as np

from dqslam._ids import ObjectRow
from dqslam.association.consistency import close_pairs
from dqslam.association.gating import in_image
from dqslam.online.keyframes import KeyframeStore
from dqslam.online.local_map import LocalMap

# So many keyframes are always looked at: the work of one look, a window.
WINDOW_KEYFRAMES = 40
# Each keyframe saves so many windows for looks further back: as much work again, now or later.
WINDOWS_SAVED_PER_KEYFRAME = 1.0
# At most so many looks at the whole path are saved.
MOST_LOOKS_SAVED = 4.0
# So many boxes determine where an object is: if the window has fewer, its last ones are looked at.
BOXES_THAT_PLACE = 8
# Objects are expected this far outside of the image, as a part of its size: the path may be off.
IMAGE_MARGIN = 0.5


class LookBackBudget:
    """Decides where the part of the path begins that the last keyframe is compared with."""

    def __init__(self) -> None:
        """Begin without savings."""
        self._saved = 0.0  # in windows
        self._asked: dict[tuple[ObjectRow, ObjectRow], int] = {}  # boxes a pair had then

    def next_window(self, keyframes: int) -> int:
        """Save for one more keyframe; return the first that is always looked at."""
        most = MOST_LOOKS_SAVED * max(keyframes / WINDOW_KEYFRAMES, 1.0)
        self._saved = min(self._saved + WINDOWS_SAVED_PER_KEYFRAME, most)
        return max(keyframes - 1 - WINDOW_KEYFRAMES, 0)

    def for_strangers(self, local: LocalMap, store: KeyframeStore) -> int:
        """Return the first keyframe to look at for boxes that no object of the map explains."""
        scene, labels = local.scene, local.scene.labels
        last = len(store.keyframes) - 1
        rows = np.flatnonzero(scene.recording.detections.pose == last - local.begin)
        called = np.unique(labels.box_class[rows[labels.are_strangers(rows)]])
        if not called.size or local.begin == 0:
            return local.begin
        alive = np.flatnonzero(labels.box_counts > 0)
        alive = alive[np.isin(labels.votes[alive].argmax(axis=1), called)]
        near = in_image(
            scene.recording.camera,
            scene.recording.odometry.pose_model,
            scene.poses[-1],
            scene.ellipsoids[alive],
            margin=IMAGE_MARGIN,
        )
        return self._spend([_anchor(store, row) for row in alive[near].tolist()], local.begin, last)

    def for_duplicates(self, local: LocalMap, store: KeyframeStore) -> int:
        """Return the first keyframe to look at for objects that may be older ones."""
        near = set(local.scene.labels.shown_objects.tolist())
        asked: dict[tuple[ObjectRow, ObjectRow], tuple[int, int]] = {}  # anchor and boxes
        for pair in close_pairs(local.scene):
            boxes = min(len(store.keyframes_of(row)) for row in pair)
            one_is_near = len(near.intersection(pair)) == 1
            if one_is_near and boxes >= max(BOXES_THAT_PLACE, 2 * self._asked.get(pair, 0)):
                asked[pair] = (min(_anchor(store, row) for row in pair), boxes)
        anchors = [anchor for anchor, _ in asked.values()]
        reached = self._spend(anchors, local.begin, len(store.keyframes) - 1)
        # What the savings do not reach is asked again when they do.
        self._asked |= {pair: boxes for pair, (at, boxes) in asked.items() if at >= reached}
        return reached

    def _spend(self, anchors: list[int], begin: int, last: int) -> int:
        """Return the earliest of some keyframes that the savings reach, and pay for it."""
        reached = min(
            [begin, *(one for one in anchors if (last - one) / WINDOW_KEYFRAMES <= self._saved)]
        )
        if reached < begin:
            self._saved -= (last - reached) / WINDOW_KEYFRAMES
        return reached


def _anchor(store: KeyframeStore, row: ObjectRow) -> int:
    """Return the keyframe from which on there are enough boxes of an object."""
    seen = store.keyframes_of(row)
    return int(seen[-BOXES_THAT_PLACE:][0]) if len(seen) else len(store.keyframes) - 1
