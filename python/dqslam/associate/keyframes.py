"""Keyframes: of a video, the images that show objects from a new side.

How a box misses the outline of an ellipsoid depends on the viewpoint, and hardly changes from one
image of a video to the next. Boxes from viewpoints this far apart are nearer to the independent
measurements that they are taken for, and there are ten times fewer of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dqslam.associate.images import group_by_pose
from dqslam.associate.rays import cameras_by_odometry, cast_rays
from dqslam.recording import Recording

# A new viewpoint: objects are seen from directions this much apart [rad] ...
PARALLAX = 0.05
# ... or their images have grown or shrunk by this share.
GROWTH = 0.15
# The share of tracklets that may have changed less.
QUANTILE = 0.75
# Share of the tracklets in an image that the last keyframe must show too.
KNOWN = 0.5


def choose_keyframes(recording: Recording, tracklet: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return rows of poses, ascending, the first pose always among them.

    An image is a keyframe when a quarter of the tracklets have moved by ``PARALLAX`` or grown by
    ``GROWTH`` since the last keyframe, or half of them are new. ``tracklet`` is that of each box,
    shape (m,).
    """
    detections = recording.detections
    rays = cast_rays(recording, cameras_by_odometry(recording))
    keyframes = [0]
    seen: dict[int, int] = {}
    for pose, rows in group_by_pose(detections.pose):
        pairs = [(seen[t], row) for row in rows if (t := int(tracklet[row])) in seen]
        if pairs and len(pairs) >= KNOWN * len(rows):
            before, now = np.array(pairs).T
            cosine = np.sum(rays.direction[before] * rays.direction[now], axis=1)
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            growth = np.abs(np.log(rays.half_width[now] / rays.half_width[before]))
            change = np.hypot(angle / PARALLAX, growth / np.log1p(GROWTH))
            if np.quantile(change, QUANTILE) < 1.0:
                continue
        keyframes.append(pose)
        seen = {int(tracklet[row]): row for row in rows}
    return np.unique(keyframes)
