"""A truncated signed distance function in the frame of an object, fused from depth images."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dqslam._checks import Floats
from dqslam.surface.body import Body
from dqslam.surface.views import View

Array = NDArray[np.float32]
# Depth images whose neighboring pixels differ by more than this multiple of the truncation show
# an edge of something there, across which depth is not interpolated.
_EDGE = 1.0
# Nothing nearer to the camera is looked at, meters.
_NEAREST = 0.05
# Behind a surface, distances count in full down to this share of the truncation, and then less.
_SURE_BEHIND = 0.5
# Behind an edge of an object, rays leave it again. Distances behind a surface count up to that from
# the pixel to the nearest outline, where rays are inside for certain, or so many voxels.
_THIN_VOXELS = 1.5
# A voxel is clearly free if it is before the surface of a pixel by so many sigmas of depth, and by
# this share of the truncation, which allows for errors of poses.
_CLEAR_SIGMAS, _CLEAR_SHARE = 2.5, 0.4
# Clearly free in this share of what is said about a voxel: it is outside. What noise says by
# chance is less.
_OUTSIDE = 0.1


class _Mean:
    """Weighted sums of what images say about voxels."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self.sum: Array = np.zeros(shape, dtype=np.float32)
        self.weight: Array = np.zeros(shape, dtype=np.float32)

    def add(self, voxels: NDArray[np.intp], values: Array, weights: Array) -> None:
        self.sum.reshape(-1)[voxels] += weights * values
        self.weight.reshape(-1)[voxels] += weights


@dataclass(eq=False)
class Volume:
    """Voxels around a body: distances to the nearest seen surface, positive in free space.

    The value of a voxel is the mean of what the images say about it, in units of the truncation.
    Voxels further than the truncation behind all surfaces have been seen by no image.

    A voxel before a surface is free for certain, but one behind a surface may be inside of the
    object or hidden by it. Where images see clearly that a voxel is free, the others do not count.
    """

    body: Body
    voxel: float
    """Side of a voxel, meters."""
    truncation: float
    """Meters."""
    half_lengths: Floats
    """How far the volume reaches from the center along the axes of the body, meters, (3,)."""
    noise: float
    """Sigma of depth at one meter, meters; it grows with the square of the distance."""
    shape: tuple[int, int, int] = field(init=False)
    images: int = field(init=False, default=0)
    """Number of images that have seen any of the voxels."""

    def __post_init__(self) -> None:
        """Count the voxels, which are not there before ``make``."""
        counts = 2 * np.ceil(self.half_lengths / self.voxel).astype(int) + 1
        self.shape = (int(counts[0]), int(counts[1]), int(counts[2]))
        self.forget()

    def make(self) -> None:
        """Make the voxels, which have seen nothing."""
        self._before, self._behind = _Mean(self.shape), _Mean(self.shape)
        self._clear: Array = np.zeros(self.shape, dtype=np.float32)
        self.images = 0

    def forget(self) -> None:
        """Give the memory of the voxels back."""
        self._before = self._behind = _Mean((0, 0, 0))
        self._clear = self._before.weight

    @property
    def origin(self) -> Floats:
        """Center of the first voxel in the frame of the object, meters, shape (3,)."""
        return -0.5 * self.voxel * (np.array(self.shape) - 1)

    @property
    def distance(self) -> Array:
        """Mean distance of each voxel in units of the truncation, -1 to 1; 1 where not seen."""
        before, behind = self._before, self._behind
        weight = before.weight + behind.weight
        is_free = self._clear > _OUTSIDE * weight
        total = before.sum + np.where(is_free, np.float32(0.0), behind.sum)
        weight = np.where(is_free, before.weight, weight)
        with np.errstate(invalid="ignore"):
            return np.where(weight > 0.0, total / weight, np.float32(1.0))

    @property
    def is_seen(self) -> NDArray[np.bool_]:
        """Whether any image says something about each voxel."""
        return (self._before.weight > 0.0) | (self._behind.weight > 0.0)

    def points(self, index: Floats) -> Floats:
        """Return places (..., 3) in the frame of the object of indices (..., 3) of voxels."""
        return np.asarray(self.origin + self.voxel * index)

    def integrate(self, view: View) -> None:
        """Fuse a depth image into the voxels that it sees."""
        x, y, z = self._in_camera(view)
        camera = view.camera
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.float32(camera.fx) * x / z + np.float32(camera.cx)
            v = np.float32(camera.fy) * y / z + np.float32(camera.cy)
        inside = (z > _NEAREST) & (u > -0.5) & (u < camera.width - 0.5)
        inside &= (v > -0.5) & (v < camera.height - 0.5)
        seen = np.flatnonzero(inside)
        if not seen.size:
            return
        u, v, z = u.ravel()[seen], v.ravel()[seen], z.ravel()[seen]
        near_u, near_v = np.rint(u).astype(np.intp), np.rint(v).astype(np.intp)
        depth = view.depth[near_v, near_u]
        facing = view.facing[near_v, near_u]
        keep = (depth > 0.0) & ((depth - z) * facing > -self.truncation)
        if not keep.any():
            return
        seen, z, facing = seen[keep], z[keep], facing[keep]
        depth = self._interpolated(view.depth, u[keep], v[keep], depth[keep])
        distance = (depth - z) * facing / np.float32(self.truncation)
        outline = view.to_outline[near_v[keep], near_u[keep]]
        behind = np.maximum(outline, np.float32(_THIN_VOXELS * self.voxel))
        keep = distance > -np.minimum(behind / np.float32(self.truncation), 1.0)
        seen, depth, facing, distance = seen[keep], depth[keep], facing[keep], distance[keep]
        # Sigma of depth grows with depth squared. It is of depth, not of the distance along the
        # normal, which a slanted surface makes smaller; but there the pixel itself is less sure.
        weight = facing * facing / np.square(np.square(depth))
        weight *= np.clip((1.0 + distance) / (1.0 - _SURE_BEHIND), 0.0, 1.0)
        is_before = distance >= 0.0
        self._before.add(seen[is_before], np.minimum(distance[is_before], 1.0), weight[is_before])
        self._behind.add(seen[~is_before], distance[~is_before], weight[~is_before])
        sigma = np.float32(self.noise / self.truncation) * depth * depth * facing
        is_clear = distance > np.maximum(_CLEAR_SIGMAS * sigma, _CLEAR_SHARE)
        self._clear.reshape(-1)[seen[is_clear]] += weight[is_clear]
        self.images += 1

    def _in_camera(self, view: View) -> tuple[Array, Array, Array]:
        """Return the centers of all voxels in the camera frame."""
        turn = view.world_from_camera.T @ self.body.world_from_object
        first = view.to_camera(self.body.center) + turn @ self.origin
        i, j, k = (self.voxel * np.arange(count) for count in self.shape)
        x, y, z = (
            (
                (first[row] + turn[row, 0] * i)[:, None, None]
                + (turn[row, 1] * j)[None, :, None]
                + (turn[row, 2] * k)[None, None, :]
            ).astype(np.float32)
            for row in range(3)
        )
        return x, y, z

    def _interpolated(self, image: Array, u: Array, v: Array, nearest: Array) -> Array:
        """Return depth between the four pixels around each place, or the nearest at an edge.

        Inverse depth is what is linear along a plane.
        """
        height, width = image.shape
        left = np.clip(np.floor(u).astype(np.intp), 0, max(width - 2, 0))
        top = np.clip(np.floor(v).astype(np.intp), 0, max(height - 2, 0))
        right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
        corners = [image[top, left], image[top, right], image[bottom, left], image[bottom, right]]
        low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
        smooth = (low > 0.0) & (high - low <= _EDGE * self.truncation)
        a, b = np.clip(u - left, 0.0, 1.0), np.clip(v - top, 0.0, 1.0)
        shares = ((1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = sum(share / corner for share, corner in zip(shares, corners, strict=True))
            return np.where(smooth, np.float32(1.0) / inverse, nearest).astype(np.float32)
