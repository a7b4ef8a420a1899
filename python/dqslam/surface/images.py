"""Depth and color images of one camera, with their times, as they are read one at a time.

Images are undistorted when they are read: whole numbers are pixel centers of the pinhole. Depth is
along the optical axis, in meters, and 0 where nothing was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dqslam import _core
from dqslam._checks import Bools, Floats, as_floats
from dqslam.io.files import FileError
from dqslam.io.frames import FrameTimes
from dqslam.io.images import timed_images
from dqslam.lens.camera import recorded_pixels

Depth = NDArray[np.float32]
Colors = NDArray[np.uint8]
# Modes of Pillow that keep more than 8 bits a pixel, whole numbers or floats.
_DEPTH_MODES = ("I;16", "I;16L", "I;16B", "I;16N", "I", "F")


@dataclass(frozen=True, eq=False)
class DepthImages:
    """Depth images in the order of time, each read when it is needed."""

    times: Floats
    """Seconds, ascending, shape (k,)."""
    read: Callable[[int], Depth]
    """Returns an image by its row: depth along the optical axis, meters, (height, width)."""
    name: str = "depth images"
    """What errors call them: the folder."""

    def __len__(self) -> int:
        """Return the number of images."""
        return len(self.times)

    def __repr__(self) -> str:
        """Show how many images there are, and where they are from."""
        return f"DepthImages({len(self)} images, {self.name!r})"

    @classmethod
    def from_arrays(cls, times: ArrayLike, depth: Sequence[ArrayLike]) -> DepthImages:
        """Take undistorted depth images in memory.

        Parameters
        ----------
        times
            Seconds, ascending, shape (k,).
        depth
            k images (height, width), meters; 0 or NaN where nothing was measured.

        Raises
        ------
        ValueError
            If the numbers of times and images differ, or times do not increase.
        """
        seconds = as_floats("times", times, [None])
        if len(seconds) != len(depth):
            raise ValueError(f"depth: expected {len(seconds)} images, one a time, got {len(depth)}")
        late = np.flatnonzero(np.diff(seconds) <= 0.0)
        if late.size:
            raise ValueError(f"times row {late[0] + 1}: time does not increase")
        return cls(seconds, lambda row: _metric(np.asarray(depth[row]), 1.0))


@dataclass(frozen=True, eq=False)
class ColorImages:
    """Color images in the order of time, each read when it is needed."""

    times: Floats
    """Seconds, ascending, shape (k,)."""
    read: Callable[[int], Colors]
    """Returns an image by its row: red, green, blue, (height, width, 3)."""

    def __len__(self) -> int:
        """Return the number of images."""
        return len(self.times)


def read_depth_images(
    folder: str | Path,
    scale: float,
    camera: _core.Camera,
    timestamps: Floats,
    frames: FrameTimes | None = None,
) -> DepthImages:
    """Find depth images of a camera: grey images of 16 bits, or of whole numbers or floats of 32.

    Parameters
    ----------
    scale
        The value of a pixel that is one meter away: 5000 in TUM's files, 1000 for millimeters.
    camera
        Whose pixels those of the depth images are, as of registered depth.
    timestamps, frames
        Times of the poses (n,) [s], and those of the images; see ``io.images.timed_images``.

    Raises
    ------
    FileError
        If the folder has no images or their times are unknown; when an image is read, if it
        cannot be, has 8 bits or several channels, or is not of the camera's size.
    ValueError
        If the scale is not a positive number.
    """
    if not (np.isfinite(scale) and scale > 0.0):
        raise ValueError(f"depth scale is {scale:g}, not a positive number")
    files, times = timed_images(folder, timestamps, frames)
    source = _sources(camera)

    def read(row: int) -> Depth:
        picture = _opened(files[row], camera)
        if picture.mode not in _DEPTH_MODES:
            message = f"is no depth image: its pixels are {picture.mode}, not grey of 16 bits"
            raise FileError(files[row], message)
        return _metric(_undistorted(_pixels(files[row], picture), source), scale)

    return DepthImages(times, read, str(folder))


def read_color_images(
    folder: str | Path,
    camera: _core.Camera,
    timestamps: Floats,
    frames: FrameTimes | None = None,
) -> ColorImages:
    """Find color images of a camera; parameters and errors are those of ``read_depth_images``."""
    files, times = timed_images(folder, timestamps, frames)
    source = _sources(camera)

    def read(row: int) -> Colors:
        picture = _opened(files[row], camera)
        return _undistorted(_pixels(files[row], picture, "RGB"), source)

    return ColorImages(times, read)


def _opened(path: Path, camera: _core.Camera) -> Any:
    from PIL import Image

    try:
        picture = Image.open(path)
    except (OSError, ValueError, SyntaxError):
        raise FileError(path, "cannot be read as an image") from None
    if picture.size != (camera.width, camera.height):
        shown = "is {} x {}, but the camera's are {} x {}: depth must be registered to its images"
        message = shown.format(*picture.size, camera.width, camera.height)
        raise FileError(path, message)
    return picture


def _pixels(path: Path, picture: Any, mode: str = "") -> NDArray[Any]:
    try:
        return np.array(picture.convert(mode) if mode else picture)
    except (OSError, ValueError, SyntaxError):
        raise FileError(path, "cannot be read as an image: its end is missing or wrong") from None


def _metric(values: NDArray[Any], scale: float) -> Depth:
    """Return depth in meters, 0 where it is not a positive number."""
    depth = values.astype(np.float32) / np.float32(scale)
    return np.where(np.isfinite(depth) & (depth > 0.0), depth, np.float32(0.0))


def _sources(camera: _core.Camera) -> NDArray[np.int64] | None:
    """Return the recorded pixel of each pixel of the pinhole, (h, w, 2) as v u; -1 beyond it.

    None for a camera without distortion.
    """
    if not camera.has_distortion:
        return None
    grid = np.meshgrid(np.arange(camera.width, dtype=float), np.arange(camera.height, dtype=float))
    source = recorded_pixels(camera, np.stack(grid, axis=-1))
    inside: Bools = np.asarray(np.isfinite(source).all(axis=2))
    place = np.rint(np.where(inside[..., None], source, -1.0)).astype(np.int64)
    inside &= ((place >= 0) & (place < [camera.width, camera.height])).all(axis=2)
    return np.where(inside[..., None], place[..., ::-1], -1)


def _undistorted(pixels: NDArray[Any], source: NDArray[np.int64] | None) -> NDArray[Any]:
    """Return the pixels of the pinhole: the nearest recorded one, as depth must not be mixed."""
    if source is None:
        return pixels
    found = pixels[source[..., 0], source[..., 1]]
    found[source[..., 0] < 0] = 0
    return found
