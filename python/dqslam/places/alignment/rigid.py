"""Motions between two maps: closed form for many sets of pairs at once.

A motion takes coordinates of map A into map B: ``q = s R p + t``. With gravity known, R turns about
z only. The scale s is 1 unless it is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dqslam._checks import Floats, Ints


@dataclass(frozen=True, eq=False)
class Motions:
    """A batch of motions."""

    rotation: Floats
    """Shape (m, 3, 3)."""
    translation: Floats
    """Meters, shape (m, 3)."""
    scale: Floats
    """Shape (m,)."""

    def __len__(self) -> int:
        """Return the number of motions."""
        return len(self.scale)

    def __getitem__(self, rows: Ints | list[int]) -> Motions:
        """Return some of them."""
        return Motions(self.rotation[rows], self.translation[rows], self.scale[rows])

    def apply(self, points: Floats) -> Floats:
        """Return points (m, n, 3) in map B, each set by its own motion; (n, 3) by all of them."""
        turned = points @ self.rotation.swapaxes(-1, -2)
        return np.asarray(self.scale[:, None, None] * turned + self.translation[:, None, :])


@dataclass(frozen=True)
class MotionModel:
    """Which motions are possible."""

    upright: bool
    """Whether both maps have z up."""
    has_scale: bool
    """Whether the unit of length of the maps may differ."""

    @property
    def axes(self) -> int:
        """The number of coordinates that decide about a match; height is judged by itself."""
        return 2 if self.upright else 3

    @property
    def size(self) -> int:
        """The degrees of freedom."""
        return (4 if self.upright else 6) + int(self.has_scale)

    def fit(self, points: Floats, targets: Floats, weights: Floats) -> Motions:
        """Return the weighted least-squares motions; shapes (m, n, 3), (m, n, 3), (m, n).

        A set whose weights are all zero keeps the identity.
        """
        total = np.maximum(weights.sum(axis=1), 1e-300)[:, None, None]
        share = weights[:, :, None] / total
        middle = (share * points).sum(axis=1, keepdims=True)
        goal = (share * targets).sum(axis=1, keepdims=True)
        p, q = points - middle, targets - goal
        moment = (share * q).swapaxes(1, 2) @ p  # sum of w q p'
        rotation = _turn(moment) if self.upright else _rotation(moment)
        scale = np.ones(len(points))
        if self.has_scale:
            # Of both spreads: noise of one side alone must not shrink the other.
            axes = self.axes
            spread = [(share * x**2)[..., :axes].sum(axis=(1, 2)) for x in (q, p)]
            known = np.minimum(*spread) > 0.0
            scale[known] = np.sqrt(spread[0][known] / spread[1][known])
        moved = scale[:, None] * (rotation @ middle.swapaxes(1, 2))[..., 0]
        return Motions(rotation, goal[:, 0] - moved, scale)


def _turn(moment: Floats) -> Floats:
    """Return the turns about z that maximize the trace with moments (m, 3, 3)."""
    sine, cosine = moment[:, 1, 0] - moment[:, 0, 1], moment[:, 0, 0] + moment[:, 1, 1]
    yaw = np.arctan2(sine, cosine)
    rotation = np.zeros_like(moment)
    rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(yaw)
    rotation[:, 1, 0] = np.sin(yaw)
    rotation[:, 0, 1] = -rotation[:, 1, 0]
    rotation[:, 2, 2] = 1.0
    return rotation


def _rotation(moment: Floats) -> Floats:
    """Return the rotations that maximize the trace with moments (m, 3, 3)."""
    left, _, right = np.linalg.svd(moment)
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return np.asarray(left @ right)
