"""Photographs behind the boxes of a page: undistorted, as the boxes are, and small."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dqslam import _core
from dqslam._checks import Bools, Floats
from dqslam._files import FileError
from dqslam.lens.camera import recorded_pixels

FOLDER = "images"  #: beside the page
_WIDTH = 640  # px, at most: the page shows them in a column of 330
_QUALITY = 80


def write_photographs(
    images: Mapping[int, Path],
    camera: _core.Camera,
    poses: int,
    page: Path,
    progress: Callable[[float], None] = lambda share: None,
) -> list[str | None]:
    """Write small undistorted copies of images, by the row of their pose, into the page's folder.

    Returns the name of the copy of each of ``poses`` poses, None without an image.

    Raises
    ------
    FileError
        If a file is no image, or not of the camera's size.
    """
    folder = page / FOLDER
    folder.mkdir()
    width = min(_WIDTH, camera.width)
    size = (width, max(1, round(camera.height * width / camera.width)))
    source = _sources(camera, *size)
    names: list[str | None] = [None] * poses
    for done, (row, path) in enumerate(sorted(images.items()), start=1):
        names[row] = f"{row:06}.jpg"
        picture = _read(path, camera)
        copy = picture.resize(size) if source is None else _sampled(picture, source)
        copy.save(folder / f"{row:06}.jpg", quality=_QUALITY)
        progress(done / len(images))
    return names


def _read(path: Path, camera: _core.Camera) -> Any:
    from PIL import Image

    try:
        picture = Image.open(path).convert("RGB")
    except (OSError, ValueError, SyntaxError):
        raise FileError(path, "cannot be read as an image") from None
    if picture.size != (camera.width, camera.height):
        shown = "is {} x {}, but the camera's are {} x {}"
        raise FileError(path, shown.format(*picture.size, camera.width, camera.height))
    return picture


def _sources(camera: _core.Camera, width: int, height: int) -> Floats | None:
    """Return where each pixel of a copy is in the image as recorded, (height, width, 2) px.

    Pixels beyond the lens are NaN. None for a camera without distortion.
    """
    if not camera.has_distortion:
        return None
    u = (np.arange(width) + 0.5) * camera.width / width - 0.5
    v = (np.arange(height) + 0.5) * camera.height / height - 0.5
    return recorded_pixels(camera, np.stack(np.meshgrid(u, v), axis=-1))


def _sampled(picture: Any, source: Floats) -> Any:
    """Return a copy whose pixels are those at places of a picture, black beyond it."""
    from PIL import Image

    pixels = np.asarray(picture)
    inside: Bools = np.asarray(np.isfinite(source).all(axis=2))
    place = np.rint(np.where(inside[..., None], source, 0.0)).astype(np.int64)
    inside &= ((place >= 0) & (place < [pixels.shape[1], pixels.shape[0]])).all(axis=2)
    u, v = np.where(inside, place[..., 0], 0), np.where(inside, place[..., 1], 0)
    return Image.fromarray(np.where(inside[..., None], pixels[v, u], 0).astype(np.uint8))
