"""Detections as COCO results: JSON, a list of ``{image_id, category_id, bbox, score}``.

``bbox`` is x, y, width, height in pixels that count from the corner of the image, so that the first
pixel spans 0 to 1. Half a pixel is therefore subtracted from the corners. A dataset, ``{images,
annotations, categories}``, can be read too. The frame is ``image_id`` if that is a whole number,
else it comes from the name of the image, see `dqslam.io.frames.frame_of`. Names of classes are
those of ``classes``, else of ``categories``, else the number. A missing score is 1.

Entries may have further keys, which we write and which COCO's own tools ignore: ``category_name``,
``timestamp`` [s], ``track_id``. Without ``timestamp`` the times are those of the frames.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from dqslam.io.detections.json_list import Entry, parse_entries
from dqslam.io.detections.table import NO_SCORE, NO_TRACK, DetectionTable
from dqslam.io.files import FileError, read_text, write_text
from dqslam.io.formats import Format, Look
from dqslam.io.frames import FrameTimes, frame_of

CORNER = 0.5  #: COCO's pixel coordinates minus ours
DIGITS = 6  #: decimals of a written box


def read_coco(
    path: str | Path,
    *,
    width: int | None = None,
    height: int | None = None,
    frames: FrameTimes | None = None,
    classes: dict[int, str] | None = None,
) -> DetectionTable:
    """Read boxes, unchecked; times of ``frames`` and names of ``classes`` override the file's."""
    text = read_text(path)
    entries, rest = parse_entries(path, text, "annotations")
    if not entries:
        raise FileError(path, "holds no boxes")
    names = _categories(path, rest.get("categories")) | (classes or {})
    images = _image_names(path, rest.get("images"))
    frame = [_frame(entry, images, frames) for entry in entries]
    class_id = [entry.integer("category_id") for entry in entries]
    box = np.array([entry.numbers("bbox", 4) for entry in entries])
    box[:, 2:] += box[:, :2]
    lines = [entry.line for entry in entries]
    given = zip(entries, class_id, strict=True)
    tracked = any("track_id" in entry.fields for entry in entries)
    return DetectionTable(
        path=str(path),
        columns=tuple(entries[0].fields),
        line=np.array(lines),
        frame=np.array(frame, dtype=np.int64),
        timestamp=_times(path, entries, frame, frames),
        box=box - CORNER,
        score=np.array([entry.number("score", NO_SCORE) for entry in entries]),
        class_id=np.array(class_id, dtype=np.int64),
        class_name=tuple(
            names.get(number, str(entry.fields.get("category_name", number)))
            for entry, number in given
        ),
        track_id=(
            np.array([entry.integer("track_id", NO_TRACK) for entry in entries], dtype=np.int64)
            if tracked
            else None
        ),
    )


def write_coco(path: str | Path, table: DetectionTable, *, times: bool = True) -> None:
    """Write boxes to a millionth of a pixel, one per line, with or without their times."""
    corner = table.box + CORNER
    size = corner[:, 2:] - corner[:, :2]
    boxes = np.round(np.hstack([corner[:, :2], size]), DIGITS).tolist()
    lines = []
    for row, box in enumerate(boxes):
        entry = {
            "image_id": int(table.frame[row]),
            "category_id": int(table.class_id[row]),
            "bbox": box,
            "score": round(float(table.score[row]), DIGITS),
            "category_name": table.class_name[row],
        }
        if times:
            entry["timestamp"] = float(table.timestamp[row])
        if table.track_id is not None:
            entry["track_id"] = int(table.track_id[row])
        lines.append(json.dumps(entry, ensure_ascii=False))
    write_text(path, "[\n" + ",\n".join(lines) + "\n]\n")


def has_times(path: str | Path) -> bool:
    """Return whether the entries of a file have times."""
    entries, _ = parse_entries(path, read_text(path), "annotations")
    return bool(entries) and "timestamp" in entries[0].fields


def read_categories(path: str | Path) -> dict[int, str]:
    """Read names of classes from a COCO file that has ``categories``, or is that list."""
    entries, _ = parse_entries(path, read_text(path), "categories")
    return {entry.integer("id"): entry.text("name") for entry in entries}


def _frame(entry: Entry, images: dict[Any, str], frames: FrameTimes | None) -> int:
    image = entry.value("image_id")
    name = images.get(image) if isinstance(image, int | str) else None
    # A dataset may number its images in any way, so names of images with times come first.
    if name is not None and frames is not None and frames.names:
        number = frame_of(name, frames)
        if number is None:
            raise entry.error(f"{frames.source} has no image {name}")
        return number
    if isinstance(image, str):
        number = frame_of(image, frames)
        if number is None:
            message = f"image_id {image!r} is no number of a frame, and in no --frame-times"
            raise entry.error(message)
        return number
    return entry.integer("image_id")


def _times(
    path: str | Path, entries: list[Entry], frame: list[int], frames: FrameTimes | None
) -> Any:
    if frames is not None:
        return frames.at(path, np.array(frame), [entry.line for entry in entries])
    if "timestamp" not in entries[0].fields:
        message = "coco has no times: give them with --frame-times FILE or --frame-rate HZ"
        raise FileError(path, message)
    return np.array([entry.number("timestamp") for entry in entries])


def _categories(path: str | Path, content: Any) -> dict[int, str]:
    if content is None:
        return {}
    try:
        return {int(item["id"]): str(item["name"]) for item in content}
    except (KeyError, TypeError, ValueError):
        raise FileError(path, "categories is no list of {id, name}") from None


def _image_names(path: str | Path, content: Any) -> dict[Any, str]:
    if content is None:
        return {}
    try:
        return {item["id"]: str(item["file_name"]) for item in content if "file_name" in item}
    except (KeyError, TypeError):
        raise FileError(path, "images is no list of {id, file_name}") from None


def _looks(look: Look) -> bool:
    return look.suffix == ".json"


COCO = Format(
    "coco",
    "its name ends in .json",
    _looks,
    read_coco,
    write_coco,
    needs_times=False,
    has_times=has_times,
    endings=(".json",),
)
