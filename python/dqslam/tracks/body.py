"""The boxes of cuboids that stand upright, and their derivatives.

A cuboid stands on its foot, the middle of its lower face, and is turned about the vertical by its
heading, along which its length is. A box reaches to the outermost of its eight corners, and an edge
changes as that corner does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats

# A corner nearer to the plane of the camera than this share of its distance has no pixel.
NEAREST = 1e-3
# Of the corners along length and width, each -1 or 1, and along the height from the foot, 0 or 2.
_SIGNS = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (0, 2)], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Views:
    """The cameras that see a cuboid, one for each box, in a frame whose third axis is up."""

    camera: _core.Camera
    rotation: Floats
    """Of the axes of each camera in the frame, shape (n, 3, 3)."""
    position: Floats
    """Meters, shape (n, 3)."""

    def select(self, rows: Bools) -> Views:
        """Return some of the views, by a flag for each (n,)."""
        return Views(self.camera, self.rotation[rows], self.position[rows])


@dataclass(frozen=True, eq=False)
class PredictedBoxes:
    """Boxes of cuboids, pixels, and how they change."""

    box: Floats
    """Shape (n, 4), of the corners in front of the camera; NaN where none is."""
    in_front: Bools
    """Whether any corner is in front of the camera, shape (n,)."""
    is_whole: Bools
    """Whether all corners are, shape (n,)."""
    corner: Floats
    """The corner that each edge touches, pixels, shape (n, 4, 2)."""
    by_place: Floats
    """By foot [m] and heading [rad], shape (n, 4, 4)."""
    by_size: Floats
    """By the logarithms of half the length, width and height, shape (n, 4, 3)."""
    by_camera: Floats
    """By small motions of the camera in its own frame [m, rad], shape (n, 4, 6)."""


def predict_boxes(
    views: Views, foot: Floats, heading: Floats, half_sides: Floats
) -> PredictedBoxes:
    """Return the boxes of a cuboid at feet (n, 3) and headings (n,), of half the sides (3,)."""
    count, camera = len(foot), views.camera
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    along, across, height = (_SIGNS * half_sides).T
    turned = np.stack(
        [cos * along - sin * across, sin * along + cos * across, np.tile(height, (count, 1))],
        axis=2,
    )
    offset = foot[:, None] + turned - views.position[:, None]
    seen = offset @ views.rotation  # rows times a matrix: its transpose turns each
    depth = seen[..., 2]
    ahead = depth > NEAREST * np.linalg.norm(offset, axis=2)
    in_front = ahead.any(axis=1)
    ray = seen[..., :2] / np.where(ahead, depth, 1.0)[..., None]
    focal, middle = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    behind = ~ahead[..., None]
    corner = np.column_stack(
        [
            np.where(behind, np.inf, ray).argmin(axis=1),
            np.where(behind, -np.inf, ray).argmax(axis=1),
        ]
    )
    rows, axis = np.arange(count)[:, None], np.tile([0, 1], 2)
    box = middle[axis] + focal[axis] * ray[rows, corner, axis]
    # An edge by its corner in the camera's frame: f / z along its own axis, -f / z ray along z.
    scale = focal[axis] / np.where(in_front[:, None], depth[rows, corner], 1.0)
    by_seen = np.zeros((count, 4, 3))
    by_seen[:, np.arange(4), axis] = scale
    by_seen[..., 2] = -scale * ray[rows, corner, axis]
    by_point = by_seen @ views.rotation.transpose(0, 2, 1)
    arm = turned[rows, corner]
    by_heading = by_point[..., 1] * arm[..., 0] - by_point[..., 0] * arm[..., 1]
    forward = np.concatenate([cos, sin], axis=1)[:, None]
    left = np.concatenate([-sin, cos], axis=1)[:, None]
    by_size = np.stack(
        [
            np.sum(by_point[..., :2] * forward, axis=2) * along[corner],
            np.sum(by_point[..., :2] * left, axis=2) * across[corner],
            by_point[..., 2] * height[corner],
        ],
        axis=2,
    )
    by_turn = np.cross(by_seen, -seen[rows, corner])
    box[~in_front] = np.nan
    return PredictedBoxes(
        box,
        in_front,
        ahead.all(axis=1),
        middle + focal * ray[rows, corner],
        np.concatenate([by_point, by_heading[..., None]], axis=2),
        by_size,
        np.concatenate([-by_seen, -by_turn], axis=2),
    )
