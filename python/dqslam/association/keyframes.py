"""Keyframes: of a video, the images that show objects from a new side.

How a box misses the outline of an ellipsoid depends on the viewpoint, and hardly changes from one
image of a video to the next. Boxes from viewpoints this far apart are nearer to the independent
measurements that they are taken for, and there are ten times fewer of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dqslam.association.images import group_by_pose
from dqslam.association.rays import Rays, cameras_by_odometry, cast_rays
from dqslam.recording import Recording

# A new viewpoint: objects are seen from directions this much apart [rad] ...
PARALLAX = 0.05
# ... or their images have grown or shrunk by this share.
GROWTH = 0.15
# The share of tracklets that may have changed less.
QUANTILE = 0.75
# Share of the tracklets in an image that the last keyframe must show too.
KNOWN = 0.5


class KeyframeChooser:
    """Tells of one image after the other whether it is a keyframe."""

    def __init__(self) -> None:
        """Begin without a keyframe."""
        self._direction: dict[int, NDArray[np.float64]] = {}
        self._half_width: dict[int, float] = {}

    def is_new(self, tracklet: NDArray[np.int64], rays: Rays) -> bool:
        """Tell whether boxes of an image, of tracklets (b,), are seen from a new side.

        They are when a quarter of the tracklets have moved by ``PARALLAX`` or grown by ``GROWTH``
        since the last keyframe, or half of them are new. The image is a keyframe then.
        """
        numbers = tracklet.tolist()
        known = [row for row, number in enumerate(numbers) if number in self._direction]
        if known and len(known) >= KNOWN * len(numbers):
            before = np.array([self._direction[numbers[row]] for row in known])
            width = np.array([self._half_width[numbers[row]] for row in known])
            cosine = np.sum(before * rays.direction[known], axis=1)
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            growth = np.abs(np.log(rays.half_width[known] / width))
            change = np.hypot(angle / PARALLAX, growth / np.log1p(GROWTH))
            if np.quantile(change, QUANTILE) < 1.0:
                return False
        self._direction = dict(zip(numbers, rays.direction, strict=True))
        self._half_width = dict(zip(numbers, rays.half_width.tolist(), strict=True))
        return True


def choose_keyframes(recording: Recording, tracklet: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return rows of poses, ascending, the first pose always among them.

    ``tracklet`` is that of each box, shape (m,).
    """
    rays = cast_rays(recording, cameras_by_odometry(recording))
    chooser = KeyframeChooser()
    keyframes = [0]
    for pose, rows in group_by_pose(recording.detections.pose):
        if chooser.is_new(tracklet[rows], rays.select(rows)):
            keyframes.append(pose)
    return np.unique(keyframes)
