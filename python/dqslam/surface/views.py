"""Depth images with their poses: where the camera was when each was taken."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dqslam import _core
from dqslam._checks import Floats, Ints
from dqslam.recording.interpolation import interpolate_poses
from dqslam.surface.images import Depth, DepthImages

# An image between two poses that are further apart than this multiple of the usual interval is
# left out, unless it is within half an interval of one of them: where the camera was is a guess.
_GAP = 5.0
# Normals are slopes of depth over so many pixels to both sides.
_SLOPE_PX = 4
# Neighboring pixels whose depth differs by more than this share show an outline between them.
_JUMP = 0.03
# The least share of a ray that is perpendicular to a surface: noise of normals must not reach 0.
_LEAST_COSINE = 0.2


@dataclass(frozen=True, eq=False)
class View:
    """A depth image and its camera."""

    camera: _core.Camera
    depth: Depth
    """Meters, shape (height, width); 0 where nothing was measured."""
    center: Floats
    """Position of the camera in the world, shape (3,)."""
    world_from_camera: Floats
    """Rotation matrix (3, 3)."""

    def to_camera(self, points_in_world: Floats) -> Floats:
        """Return points (..., 3) of the world in the camera frame."""
        return np.asarray((points_in_world - self.center) @ self.world_from_camera)

    @cached_property
    def facing(self) -> Depth:
        """The distance of a pixel's surface along its normal per meter of depth, (height, width).

        This is n.(x y 1), where n is the unit normal and (x y 1) the ray of the pixel.
        """
        camera, depth = self.camera, self.depth
        u = ((np.arange(camera.width) - camera.cx) / camera.fx).astype(np.float32)
        v = ((np.arange(camera.height) - camera.cy) / camera.fy).astype(np.float32)[:, None]
        # For a plane, inverse depth is linear in the pixel: n.(x y 1) / offset. A missing
        # neighbor makes a slope that is not finite, and the surface counts as facing the ray.
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = np.float32(1.0) / depth
            a = _slope(inverse, axis=1) * np.float32(camera.fx)
            b = _slope(inverse, axis=0) * np.float32(camera.fy)
            c = inverse - a * u - b * v
            found = inverse / np.sqrt(a * a + b * b + c * c)
        straight = np.sqrt(1.0 + u * u + v * v)
        return np.where(np.isfinite(found), np.clip(found, _LEAST_COSINE, straight), 1.0).astype(
            np.float32
        )

    @cached_property
    def to_outline(self) -> Depth:
        """How far a pixel's surface is from the nearest outline across the ray, m, (height, width).

        An outline is where depth jumps or is missing.
        """
        from scipy import ndimage

        depth = self.depth
        low = ndimage.minimum_filter(depth, size=3, mode="nearest")
        high = ndimage.maximum_filter(depth, size=3, mode="nearest")
        jumps = (low <= 0.0) | (high - low > _JUMP * depth)
        pixels = ndimage.distance_transform_edt(~jumps)
        across = pixels * depth / min(self.camera.fx, self.camera.fy)
        return np.asarray(across, dtype=np.float32)


def _slope(values: Depth, axis: int) -> Depth:
    """Return the change of values per pixel along an axis, from both sides where they are there."""
    moved = np.moveaxis(values, axis, 0)
    count = len(moved)
    low = np.clip(np.arange(count) - _SLOPE_PX, 0, count - 1)
    high = np.clip(np.arange(count) + _SLOPE_PX, 0, count - 1)
    width = (high - low).astype(np.float32).reshape(-1, *[1] * (moved.ndim - 1))
    return np.asarray(np.moveaxis((moved[high] - moved[low]) / width, 0, axis))


@dataclass(frozen=True, eq=False)
class Views:
    """Depth images along an estimated path."""

    camera: _core.Camera
    images: DepthImages
    rows: Ints
    """Rows of the images whose pose is known, shape (k,)."""
    poses: Floats
    """world_from_camera at the time of each of these, shape (k, 7)."""

    @classmethod
    def along(
        cls, camera: _core.Camera, timestamps: Floats, poses: Floats, images: DepthImages
    ) -> Views:
        """Give images the poses at their times, between poses (n, 7) at ascending times (n,).

        Raises
        ------
        ValueError
            If no image is of the time of the path.
        """
        rows = known_times(timestamps, images.times)
        if not rows.size:
            raise ValueError(
                f"{images.name}: no image is of the time of the path: images from "
                f"{images.times[0]:.6f} to {images.times[-1]:.6f} s, poses from "
                f"{timestamps[0]:.6f} to {timestamps[-1]:.6f} s"
            )
        return cls(camera, images, rows, poses_at(timestamps, poses, images.times[rows]))

    def __len__(self) -> int:
        """Return the number of images whose pose is known."""
        return len(self.rows)

    @property
    def times(self) -> Floats:
        """Times of the images whose pose is known, shape (k,)."""
        return np.asarray(self.images.times[self.rows])

    def view(self, place: int) -> View:
        """Read an image, by its place among those whose pose is known."""
        from scipy.spatial.transform import Rotation

        depth = self.images.read(int(self.rows[place]))
        wanted = (self.camera.height, self.camera.width)
        if depth.shape != wanted:
            raise ValueError(f"depth row {self.rows[place]}: expected {wanted}, got {depth.shape}")
        turn = Rotation.from_quat(self.poses[place, 3:]).as_matrix()
        return View(self.camera, depth, self.poses[place, :3], turn)

    def __iter__(self) -> Iterator[View]:
        """Read the images one after the other."""
        return (self.view(place) for place in range(len(self)))

    def see(self, place: int, center: Floats, radius: float) -> bool:
        """Return whether a sphere in the world may be in an image, by its place."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_quat(self.poses[place, 3:]).as_matrix()
        x, y, z = (center - self.poses[place, :3]) @ turn
        if z + radius <= 0.0:
            return False
        camera = self.camera
        sides = (
            (-(camera.cx + 0.5) / camera.fx, (camera.width - 0.5 - camera.cx) / camera.fx, x),
            (-(camera.cy + 0.5) / camera.fy, (camera.height - 0.5 - camera.cy) / camera.fy, y),
        )
        return all(
            (across - low * z) / np.hypot(1.0, low) > -radius
            and (high * z - across) / np.hypot(1.0, high) > -radius
            for low, high, across in sides
        )


def known_times(timestamps: Floats, times: Floats) -> Ints:
    """Return the rows of times (k,) at which the pose is known from poses at timestamps (n,)."""
    usual = float(np.median(np.diff(timestamps))) if len(timestamps) > 1 else 0.0
    after = np.clip(np.searchsorted(timestamps, times), 1, max(len(timestamps) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(timestamps) - 1)
    off = np.minimum(np.abs(times - timestamps[before]), np.abs(times - timestamps[after]))
    between = (times >= timestamps[before]) & (times <= timestamps[after])
    short = timestamps[after] - timestamps[before] <= _GAP * usual
    return np.flatnonzero((off <= 0.5 * usual) | (between & short))


def poses_at(timestamps: Floats, poses: Floats, times: Floats) -> Floats:
    """Return the poses at times (k,), (k, 7), interpolated between poses (n, 7)."""
    if len(timestamps) == 1:
        return np.repeat(poses, len(times), axis=0)
    return interpolate_poses(timestamps, poses, times)
