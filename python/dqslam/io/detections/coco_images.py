"""The images of a COCO dataset: which frame each is, and their size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dqslam._checks import Ints
from dqslam.io.detections.json_list import Entry
from dqslam.io.files import FileError
from dqslam.io.formats import ReadContext
from dqslam.io.image_names import ImageNameError, frames_of_images

FRAME_KEYS = ("frame_id", "frame_index")  #: of datasets of videos


@dataclass(frozen=True)
class CocoImages:
    """What tells the frame of each entry: the names of images (m,), or numbers (m,)."""

    names: list[str] | None
    numbers: Ints | None
    all_names: tuple[str, ...] = ()
    size: tuple[int, int] | None = None


def coco_images(
    path: str | Path, entries: Sequence[Entry], images: Any, key: str, context: ReadContext
) -> CocoImages:
    """Find what tells the frame of each entry, by its ``key``, mostly image_id.

    Ids of images are arbitrary, so the names of files come first, unless no number in them tells a
    frame. Datasets of videos have the frame itself.
    """
    by_id = _by_id(path, images)
    size = _size(path, by_id.values(), context)
    ids = [entry.value(key) for entry in entries]
    for entry, image in zip(entries, ids, strict=True):
        if isinstance(image, bool) or not isinstance(image, int | float | str):
            raise entry.error(f"{key} is {image!r}, not a name or a number")
    used = [by_id.get(image, {}) for image in ids]
    video = next((one for one in FRAME_KEYS if used and all(one in image for image in used)), None)
    if video is not None:
        videos = {one.get("video_id") for one in by_id.values()}
        if len(videos) > 1:
            raise FileError(path, f"its images are of {len(videos)} videos, not of one")
        return CocoImages(None, _integers(entries, [one[video] for one in used], video), size=size)
    if used and all("file_name" in one for one in used):
        names = [str(one["file_name"]) for one in used]
        every = tuple(str(one["file_name"]) for one in by_id.values() if "file_name" in one)
        if _tell_frames(path, names, every, ids, context):
            return CocoImages(names, None, every, size)
    if any(isinstance(image, str) for image in ids):
        return CocoImages([str(image) for image in ids], None, size=size)
    return CocoImages(None, _integers(entries, ids, key), size=size)


def _tell_frames(
    path: str | Path,
    names: Sequence[str],
    every: Sequence[str],
    ids: Sequence[Any],
    context: ReadContext,
) -> bool:
    """Return whether names of files tell frames or times; note it where ids differ."""
    if context.frames is not None and context.frames.names:
        return True
    try:
        frames, times = frames_of_images([*names, *every])
    except ImageNameError as error:
        if error.is_double or any(isinstance(image, str) for image in ids):
            raise FileError(path, f"{[*names, *every][error.row]}: {error}") from None
        context.notes.doubt(path, f"image_id is the frame, as no file_name tells it: {error}")
        return False
    if times is None and any(
        frame != image for frame, image in zip(frames.tolist(), ids, strict=False)
    ):
        context.notes.doubt(
            path, "the frame is the number in file_name, which differs from image_id"
        )
    return True


def _by_id(path: str | Path, images: Any) -> dict[Any, dict[str, Any]]:
    if images is None:
        return {}
    try:
        found: dict[Any, dict[str, Any]] = {}
        for item in images:
            if item["id"] in found and item != found[item["id"]]:
                raise FileError(path, f"two images have the id {item['id']}")
            found[item["id"]] = dict(item)
        return found
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(path, "images is no list of {id, file_name}") from None


def _size(path: str | Path, images: Any, context: ReadContext) -> tuple[int, int] | None:
    """Return the size of the images; of several sizes one that is not the camera's."""
    sizes = {
        (one["width"], one["height"])
        for one in images
        if isinstance(one.get("width"), int) and isinstance(one.get("height"), int)
    }
    sizes.discard((0, 0))
    other = sorted(sizes - {context.size})
    if len(sizes) > 1 and context.size is None:
        context.notes.doubt(path, f"its images have {len(sizes)} sizes")
    if context.size is None or not other:
        return context.size if sizes and not other else None
    return other[0]


def _integers(entries: Sequence[Entry], values: Sequence[Any], key: str) -> Ints:
    numbers = []
    for entry, value in zip(entries, values, strict=True):
        whole = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
        if not whole or isinstance(value, bool) or not abs(value) < 2**53:
            raise entry.error(f"{key} is {str(value)[:40]}, not a whole number")
        numbers.append(int(value))
    return np.array(numbers, dtype=np.int64)
