"""Keyframes: of a video, the images that show objects from a new side.

How a box misses the outline of an ellipsoid depends on the viewpoint, and hardly changes from one
image of a video to the next. Boxes from viewpoints this far apart are nearer to the independent
measurements that they are taken for, and there are ten times fewer of them.
"""

from __future__ import annotations

import numpy as np

from dqslam._checks import Floats, Ints
from dqslam._ids import Tracklet
from dqslam.association.images import group_by_pose
from dqslam.association.rays import Rays, cameras_by_odometry, cast_rays
from dqslam.recording import Recording

# A tracklet is seen from a new side when its direction has changed by this [rad] ...
MIN_PARALLAX = 0.05
# ... or its box has grown or shrunk by this share.
MIN_GROWTH = 0.15
# An image is a keyframe unless this share of its tracklets are seen from where they were ...
MAX_SHARE_UNCHANGED = 0.75
# ... and the last keyframe shows this share of them: fewer may be seen from anywhere.
MIN_SHARE_KNOWN = 0.5


class KeyframeChooser:
    """Chooses keyframes from one image after the other."""

    def __init__(self) -> None:
        """Begin without a keyframe."""
        self._direction: dict[Tracklet, Floats] = {}
        self._half_width: dict[Tracklet, float] = {}

    def choose(self, tracklets: Ints, rays: Rays) -> bool:
        """Make an image the last keyframe if its boxes are seen from a new side; return whether.

        They are when a quarter of their tracklets (b,) have moved by ``MIN_PARALLAX`` or grown by
        ``MIN_GROWTH`` since the last keyframe, or half of them are new.
        """
        numbers: list[Tracklet] = tracklets.tolist()
        known = [row for row, number in enumerate(numbers) if number in self._direction]
        if known and len(known) >= MIN_SHARE_KNOWN * len(numbers):
            before = np.array([self._direction[numbers[row]] for row in known])
            width = np.array([self._half_width[numbers[row]] for row in known])
            cosine = np.sum(before * rays.direction[known], axis=1)
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            growth = np.abs(np.log(rays.half_width[known] / width))
            change = np.hypot(angle / MIN_PARALLAX, growth / np.log1p(MIN_GROWTH))
            if _quantile(change, MAX_SHARE_UNCHANGED) < 1.0:
                return False
        self._direction = dict(zip(numbers, rays.direction, strict=True))
        self._half_width = dict(zip(numbers, rays.half_width.tolist(), strict=True))
        return True


def _quantile(values: Floats, share: float) -> float:
    """Return a quantile of some numbers as ``np.quantile`` does, which takes long for a few."""
    ordered = sorted(values.tolist())
    below, part = divmod(share * (len(ordered) - 1), 1.0)
    low, high = ordered[int(below)], ordered[min(int(below) + 1, len(ordered) - 1)]
    return float(low + part * (high - low))


def choose_keyframes(recording: Recording, tracklets: Ints) -> Ints:
    """Return rows of poses, ascending, the first pose always among them.

    ``tracklets`` are those of the boxes, shape (m,).
    """
    rays = cast_rays(recording, cameras_by_odometry(recording))
    chooser = KeyframeChooser()
    keyframes = [0]
    for pose, rows in group_by_pose(recording.detections.pose):
        if chooser.choose(tracklets[rows], rays.select(rows)):
            keyframes.append(pose)
    return np.unique(keyframes)
