"""What the association of a session remembers: keyframes, their boxes, and what these show."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from dqslam._checks import Bools, Floats, Ints
from dqslam.assumptions import OdometryNoise, SizePrior, SizePriors
from dqslam.online.integrated_odometry import Leg


@dataclass(eq=False)
class Keyframe:
    """An image whose boxes take part in the estimate."""

    pose: int
    """Row of the session."""
    timestamp: float
    leg: Leg
    """The way from the keyframe before."""
    sight: Ints
    """Rows of the boxes in the session, shape (b,)."""
    box: Floats
    truncated: Bools
    class_id: Ints
    claim: Ints
    """Ids that a tracker gave, -1 for none."""
    tracklet: Ints
    object: Ints
    """Row of the object that each shows, -1 while it waits."""


class Journal:
    """Keyframes in the order of time, and the objects that their boxes show.

    Rows of objects are those of the session.
    """

    def __init__(self, size_prior: SizePrior | SizePriors | None) -> None:
        """Begin without a keyframe."""
        self.size_prior = size_prior
        """None until some objects have told it."""
        self.odometry_noise = OdometryNoise()
        """Of one step, where that is estimated."""
        self.keyframes: list[Keyframe] = []
        self._class_ids: dict[str, int] = {}
        self.votes = np.zeros((0, 0), dtype=np.int64)
        """How often each object was called each class, shape (o, c)."""
        self.object_of_tracklet: dict[int, int] = {}
        self.left_out: dict[int, str] = {}
        """Objects that take no part in the estimate, and why."""
        self.map_covariance: dict[int, Floats] = {}
        """Of objects that were known before the session, (9, 9)."""
        self._keyframe_of: dict[int, int] = {}  # of a box
        self._boxes: dict[int, set[int]] = {}  # of an object
        self._born: list[int] = []
        self._looked: dict[int, tuple[Ints, Ints]] = {}  # of a step: boxes and their tracklets

    # ---- images

    def add_keyframe(self, frame: Keyframe) -> None:
        """Add the last image; its boxes wait."""
        for sight in frame.sight.tolist():
            self._keyframe_of[sight] = len(self.keyframes)
        self.keyframes.append(frame)

    def class_ids(self, names: list[str]) -> Ints:
        """Return a number for each name, the same for the same."""
        return np.array(
            [self._class_ids.setdefault(name, len(self._class_ids)) for name in names],
            dtype=np.int64,
        )

    @property
    def class_names(self) -> list[str]:
        """What the numbers stand for."""
        return list(self._class_ids)

    def remember(self, step: int, boxes: Ints, tracklet: Ints) -> None:
        """Remember the tracklets of some boxes of a step."""
        self._looked[step] = (boxes, tracklet)

    def shown(self) -> dict[int, tuple[Ints, Ints]]:
        """Return the boxes that each step looked at and the objects they show, -1 for none."""
        own = self.object_of_tracklet
        shown = {
            step: (boxes, np.array([own.get(one, -1) for one in tracklet.tolist()], dtype=np.int64))
            for step, (boxes, tracklet) in self._looked.items()
        }
        for frame in self.keyframes:
            shown[frame.pose] = (shown[frame.pose][0], frame.object)
        return shown

    # ---- objects

    def boxes_of(self, number: int) -> set[int]:
        """Return the boxes that show an object, rows of the session."""
        return self._boxes.get(number, set())

    def keyframes_of(self, number: int) -> list[int]:
        """Return the keyframes that show an object, ascending."""
        return sorted(self._keyframe_of[sight] for sight in self.boxes_of(number))

    def called(self, number: int) -> Counter[str]:
        """Return how often an object was called what."""
        votes = self.votes[number].tolist()
        return Counter({name: n for name, n in zip(self._class_ids, votes, strict=True) if n})

    def give(self, sight: int, number: int) -> None:
        """Let a box show another object, or none where the number is -1."""
        frame = self.keyframes[self._keyframe_of[sight]]
        row = int(np.searchsorted(frame.sight, sight))
        before, class_id = int(frame.object[row]), frame.class_id[row]
        if before >= 0:
            self.votes[before, class_id] -= 1
            self._boxes[before].discard(sight)
        if number >= 0:
            self.votes[number, class_id] += 1
            self._boxes.setdefault(number, set()).add(sight)
        frame.object[row] = number

    def claim_of(self, number: int) -> int:
        """Return the id that most boxes of an object claim, -1 for none."""
        frames = [self.keyframes[self._keyframe_of[sight]] for sight in self.boxes_of(number)]
        claims = Counter(
            int(claim)
            for sight, frame in zip(self.boxes_of(number), frames, strict=True)
            for claim in frame.claim[frame.sight == sight]
        )
        return claims.most_common(1)[0][0] if claims else -1

    def bear_objects(self, count: int) -> None:
        """Take in objects that boxes without ids have told."""
        known = len(self.votes)
        self.know_objects(known + count)
        self._born += range(known, known + count)

    def hidden(self) -> set[int]:
        """Return objects that were born here and have no box any more, or are left out."""
        return {row for row in self._born if not self.votes[row].any()} | set(self.left_out)

    def know_objects(self, count: int) -> None:
        """Make room for objects that the session has; nothing is known of their boxes."""
        grown = np.zeros((max(count, len(self.votes)), len(self._class_ids)), dtype=np.int64)
        grown[: len(self.votes), : self.votes.shape[1]] = self.votes
        self.votes = grown

    def know_map_object(self, number: int, class_name: str, covariance: Floats) -> None:
        """Take in an object of a map: its covariance (9, 9)."""
        class_id = int(self.class_ids([class_name])[0])
        self.know_objects(number + 1)
        self.votes[number, class_id] += 1
        self.map_covariance[number] = covariance
