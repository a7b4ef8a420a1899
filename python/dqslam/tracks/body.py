"""The boxes of cuboids that stand upright, and their derivatives.

A cuboid stands on its foot, the middle of its lower face, and is turned about the vertical by its
heading, along which its length is. A box reaches to the outermost of its eight corners. Where two
of them are within a pixel, the edge is between them: it changes smoothly from one to the other, as
at a car, whose corners are round, and an estimate does not get caught at the kink.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats

# A corner nearer to the plane of the camera than this share of its distance has no pixel.
NEAREST = 1e-3
# An edge is the mean of the corners, each weighted by exp(its pixels outward / this).
ROUNDED_PX = 0.5
_OUTWARD = np.array([-1.0, -1.0, 1.0, 1.0])
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
    _seen: Floats
    """The corners in the frames of the cameras, meters, shape (n, 8, 3)."""
    _by_seen: Floats
    """By these, shape (n, 4, 8, 3)."""

    @cached_property
    def by_camera(self) -> Floats:
        """By small motions of the camera in its own frame [m, rad], shape (n, 4, 6)."""
        by_turn = np.cross(self._by_seen, -self._seen[:, None]).sum(axis=2)
        return np.concatenate([-self._by_seen.sum(axis=2), -by_turn], axis=2)


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
    pixel = middle + focal * ray
    # Of each edge, the weights of the corners, and by them how the edge changes with each.
    edges = pixel[..., axis].transpose(0, 2, 1)
    outward = _OUTWARD[:, None] * edges
    outward = np.where(ahead[:, None], outward, -np.inf)
    most = outward.max(axis=2, keepdims=True, initial=-np.finfo(np.float64).max)
    weight = np.exp((outward - most) / ROUNDED_PX)
    weight /= np.maximum(weight.sum(axis=2, keepdims=True), 1.0)
    box = np.sum(weight * edges, axis=2)
    share = weight * (1.0 + _OUTWARD[:, None] * (edges - box[..., None]) / ROUNDED_PX)
    # A pixel by its corner in the camera's frame: f / z along its own axis, -f / z ray along z.
    scale = share * focal[axis][:, None] / np.where(ahead, depth, 1.0)[:, None]
    by_seen = np.zeros((count, 4, 8, 3))
    by_seen[:, np.arange(4), :, axis] = scale.transpose(1, 0, 2)
    by_seen[..., 2] = -scale * ray[..., axis].transpose(0, 2, 1)
    by_point = by_seen @ views.rotation.transpose(0, 2, 1)[:, None]
    x, y, z = by_point.transpose(3, 0, 1, 2)
    arm = turned[:, None]
    by_heading = np.sum(y * arm[..., 0] - x * arm[..., 1], axis=2)
    by_size = np.stack(
        [
            np.sum((x * cos[:, :, None] + y * sin[:, :, None]) * along, axis=2),
            np.sum((y * cos[:, :, None] - x * sin[:, :, None]) * across, axis=2),
            np.sum(z * height, axis=2),
        ],
        axis=2,
    )
    by_foot = by_point.sum(axis=2)
    box[~in_front] = np.nan
    return PredictedBoxes(
        box,
        in_front,
        ahead.all(axis=1),
        pixel[rows, corner],
        np.concatenate([by_foot, by_heading[..., None]], axis=2),
        by_size,
        seen,
        by_seen,
    )
