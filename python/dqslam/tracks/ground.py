"""The ground that things move on, as far as the cameras and what they saw show it.

A robot's camera stays at one height above the ground and is not tilted sideways to it, so the
ground is the plane along the path and the camera's x axis, so far below: uphill and downhill, and
where a drifting path is tilted. A camera in the hand does not: then the ground is level. Of the
two, that one is taken on which things stand with less scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats, Ints
from dqslam.metrics.upright import up_direction

# The ground is known by so many lower ends of things at least.
FEWEST_FEET = 3
# Things that stand on the ground are off it by this at least [m]: curbs, and errors of boxes.
LEAST_SIGMA_M = 0.05
# Beside the path, the ground falls or rises by this share of the distance.
SIDE_SLOPE = 0.02
# Without a ground, the foot is anywhere within this height [m].
UNKNOWN_SIGMA_M = 100.0
# Rounds in which the scatter about the ground is found.
_ROUNDS = 10
# A camera's x axis tells the slope across the path if so much of it is across.
_LEAST_ACROSS = 0.5
# Of a path, at most so many places hold the ground.
_MOST_ANCHORS = 2000


@dataclass(frozen=True, eq=False)
class Ground:
    """Heights of the ground in a frame whose third axis is up."""

    world_from_ground: Floats
    """Rotation about the world's origin, shape (3, 3)."""
    anchors: Floats
    """Places whose heights are known, meters, shape (a, 2)."""
    heights: Floats
    """Of the ground at these places, meters, shape (a,)."""
    slopes: Floats
    """Of the ground there, shape (a, 2)."""
    base_sigma: float
    """Of the height at which a thing stands near the places, each thing by itself, meters."""
    common_sigma: float
    """Of the heights of the ground, in common, meters."""
    kind: Literal["below the path", "level", "unknown"]
    feet: int
    """How many lower ends of things have shown it."""

    def height(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the height [m] at places (n, 2), shape (n,), and its slope there, (n, 2)."""
        nearest = self._nearest.query(places)[1]
        slope = self.slopes[nearest]
        rise = np.sum(slope * (places - self.anchors[nearest]), axis=1)
        return self.heights[nearest] + rise, slope

    def sigma(self, places: Floats) -> float:
        """Return the sigma [m] of the height at which a thing stands at places (n, 2), in the middle.

        Beside a path the ground may fall or rise as roads do for the rain.
        """
        aside = np.median(self._own_sigma(places))
        return float(np.hypot(aside, self.common_sigma))

    def corrected(self, above: Floats, variance: Floats) -> Ground:
        """Return the ground as corrected by heights [m] at which things stand above it, (t,).

        ``variance`` [m^2] (t,) is that of what these things say by themselves, without the ground.
        """
        weight = 1.0 / (variance + self.base_sigma**2)
        total = self.common_sigma**-2 + weight.sum()
        rise = float(weight @ above / total)
        return replace(self, heights=self.heights + rise, common_sigma=float(total**-0.5))

    def _own_sigma(self, places: Floats) -> Floats:
        """Return the sigma [m] of the height of things at places (n, 2), beside what is common."""
        if self.kind != "below the path":
            return np.full(len(places), self.base_sigma)
        return np.hypot(self.base_sigma, SIDE_SLOPE * self._nearest.query(places)[0])

    @cached_property
    def _nearest(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.anchors)


def find_ground(cameras: Floats, feet: Floats) -> Ground:
    """Find the ground from camera poses and lower ends of things.

    Parameters
    ----------
    cameras
        world_from_camera, held without roll, shape (n, 7).
    feet
        Lower ends in the world, meters, shape (f, 3), one for each thing.
    """
    from scipy.spatial.transform import Rotation

    up = up_direction(cameras)
    axis = np.eye(3)[int(np.argmin(np.abs(up)))]
    east = np.cross(axis, up)
    east /= np.linalg.norm(east)
    turn = np.column_stack([east, np.cross(up, east), up])
    cameras = cameras[:: -(-len(cameras) // _MOST_ANCHORS)]
    right = Rotation.from_quat(cameras[:, 3:]).as_matrix()[:, :, 0] @ turn
    path, feet = cameras[:, :3] @ turn, feet @ turn
    level = (path[:1, :2], np.zeros(1), np.zeros((1, 2)))
    below = (path[:, :2], path[:, 2], _slopes(path, right))
    if len(feet) < FEWEST_FEET:
        level = (path[:1, :2], path[:, 2].mean(keepdims=True), np.zeros((1, 2)))
        return Ground(turn, *level, LEAST_SIGMA_M, UNKNOWN_SIGMA_M, "unknown", len(feet))
    choices = [
        _fit(Ground(turn, *shape, LEAST_SIGMA_M, 0.0, kind, len(feet)), feet)
        for kind, shape in (("below the path", below), ("level", level))
    ]
    return min(choices, key=lambda one: np.median(one._own_sigma(feet[:, :2])))


def _fit(ground: Ground, feet: Floats) -> Ground:
    """Return a ground at the height, and with the scatter, of things that stand at feet (f, 3).

    The height is the weighted median: some things hang, or move. Half of the others are off by less
    than 0.6745 of their sigma, which grows with the distance from the path.
    """
    off = feet[:, 2] - ground.height(feet[:, :2])[0]
    base = LEAST_SIGMA_M
    for _ in range(_ROUNDS):
        sigma = replace(ground, base_sigma=base)._own_sigma(feet[:, :2])
        order = np.argsort(off)
        share = np.cumsum(sigma[order] ** -2.0)
        middle = float(off[order][np.searchsorted(share, 0.5 * share[-1])])
        factor = float(np.median(np.abs(off - middle) / sigma)) / 0.6745
        if factor <= 1.0:
            break
        base *= factor
    # The median is less certain than a mean by pi / 2; of few feet, the scatter is itself unsure.
    common = np.sqrt(0.5 * np.pi / np.sum(sigma**-2.0) * (1.0 + 3.0 / len(feet)))
    heights = ground.heights + middle
    return replace(ground, heights=heights, base_sigma=base, common_sigma=float(common))


def _slopes(path: Floats, right: Floats) -> Floats:
    """Return the slope of the ground along a path (n, 3) and x axes of its cameras (n, 3), (n, 2).

    Along the path over the length of a car at least, so that jitter is no slope. Where it does not
    go so far, and across an axis along the path, the ground is level.
    """
    reach = 4.0
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)))
    first = np.searchsorted(length, length - reach).clip(max=len(path) - 1)
    last = np.searchsorted(length, length + reach).clip(max=len(path) - 1)
    run = path[last] - path[first]
    run[np.linalg.norm(run, axis=1) < 0.5 * reach] = [1e-9, 0.0, 0.0]
    # The least slope g with g . d = rise of the run, and of the axis less its part along the run.
    along = run / np.linalg.norm(run[:, :2], axis=1, keepdims=True)
    across = right - np.sum(right[:, :2] * along[:, :2], axis=1, keepdims=True) * along
    width = np.linalg.norm(across[:, :2], axis=1, keepdims=True)
    across = np.where(width > _LEAST_ACROSS, across / np.maximum(width, _LEAST_ACROSS), 0.0)
    return np.asarray(along[:, :2] * along[:, 2:] + across[:, :2] * across[:, 2:])


def with_unknown_height(ground: Ground) -> Ground:
    """Return a ground of the same shape whose height is unknown."""
    return replace(ground, common_sigma=UNKNOWN_SIGMA_M)


def feet_of_ellipsoids(ellipsoids: Floats, up: Floats) -> Floats:
    """Return the lowest points of ellipsoids (o, 9) straight below their centers, shape (o, 3)."""
    shape = _core.ellipsoid_shapes(ellipsoids)
    reach = np.sqrt(np.einsum("i,nij,j->n", up, shape, up))
    return np.asarray(ellipsoids[:, :3] - reach[:, None] * up)


def feet_of_boxes(
    camera: _core.Camera, cameras: Floats, box: Floats, usable: Bools, height_m: Floats
) -> Floats:
    """Return where things of known heights (m,) stand by their boxes (m, 4) alone, (u, 3).

    ``usable`` (m,) flags those whose upper and lower edges are not cut, and ``cameras`` (m, 7) are
    world_from_camera.
    """
    rows: Ints = np.flatnonzero(usable)
    depth = camera.fy * height_m[rows] / (box[rows, 3] - box[rows, 1])
    points = np.zeros((len(rows), 7))
    points[:, 0] = depth * (0.5 * (box[rows, 0] + box[rows, 2]) - camera.cx) / camera.fx
    points[:, 1] = depth * (box[rows, 3] - camera.cy) / camera.fy
    points[:, 2], points[:, 6] = depth, 1.0
    return np.asarray(_core.compose(_core.PoseModel.SE3, cameras[rows], points)[:, :3])
