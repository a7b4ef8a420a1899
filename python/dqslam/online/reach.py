"""How many keyframes back the association must look, for objects that come into view again."""

from __future__ import annotations

import numpy as np

from dqslam import _core
from dqslam._checks import Floats
from dqslam.online.journal import Journal

# Keyframes that are always looked at.
WINDOW = 40
# Boxes of an object that tell where it is: if the window has fewer, its last ones are looked at.
ENOUGH_BOXES = 8
# One that was expected and not seen is not expected for so many keyframes, then twice as many.
FIRST_PAUSE, LONGEST_PAUSE = 2, 64
# Objects are expected this far outside of the image, as a part of its size: the path may be off.
MARGIN = 0.5


class Reach:
    """Tells where the part of the path begins that a keyframe is compared with."""

    def __init__(self, camera: _core.Camera, pose_model: _core.PoseModel) -> None:
        """Begin without expectations."""
        self._camera = camera
        self._pose_model = pose_model
        self._pauses: dict[int, tuple[int, int]] = {}  # of an object: until when, and how long

    def begin(self, journal: Journal, session: _core.Session) -> int:
        """Return the first keyframe to look at, once the last one is in the journal."""
        last = len(journal.keyframes) - 1
        begin = max(last - WINDOW, 0)
        if begin == 0:
            return begin
        called = set(journal.keyframes[last].class_id.tolist())
        pose = session.pose_at(journal.keyframes[last].pose)
        for number in self._in_view(pose, session.ellipsoids):
            seen = journal.keyframes_of(number)
            if not seen or journal.votes[number].argmax() not in called:
                continue
            anchor = seen[-min(ENOUGH_BOXES, len(seen))]
            if seen[-1] >= last - 1:  # the last keyframe showed it
                self._pauses.pop(number, None)
            if anchor < begin and self._is_expected(number, last):
                begin = anchor
        return begin

    def _is_expected(self, number: int, keyframe: int) -> bool:
        until, pause = self._pauses.get(number, (0, FIRST_PAUSE))
        if keyframe < until:
            return False
        self._pauses[number] = (keyframe + pause, min(2 * pause, LONGEST_PAUSE))
        return True

    def _in_view(self, pose: Floats, ellipsoids: Floats) -> list[int]:
        if not len(ellipsoids):
            return []
        here = np.repeat(pose[None], len(ellipsoids), axis=0)
        box, in_front = _core.project_to_boxes(self._pose_model, self._camera, here, ellipsoids)
        size = np.array([self._camera.width, self._camera.height])
        inside = np.all((box[:, 2:] > -MARGIN * size) & (box[:, :2] < (1 + MARGIN) * size), axis=1)
        return np.flatnonzero(in_front & inside).tolist()
